#include "gpu/light/gpu_photons.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <glm/vec3.hpp>
#include <span>

namespace hpr {
namespace {

/// As PhotonMap in photons.glsl.
struct GpuPhotonMap {
  std::uint64_t starts = 0;
  std::uint64_t positions = 0;
  std::uint64_t lights = 0;
  glm::dvec3 origin{0.0};
  double scale = 1.0;
  double radius = 0.0;
  double flux_unit = 1.0;
  double cells_per_unit = 0.0;
  std::uint32_t photons = 0;
  std::uint32_t last_slot = 0;
  std::uint32_t row_step = 0;
  std::uint32_t layer_step = 0;
};
static_assert(sizeof(GpuPhotonMap) == 96);

/// As PhotonMaps in photons.glsl.
struct GpuPhotonMaps {
  std::array<GpuPhotonMap, 4> maps{};
  double near_distance = 0.0;
  double footprint = 0.0;
};
static_assert(sizeof(GpuPhotonMaps) == 400);

/// Where arrays begin in a buffer, each at a multiple of the largest element.
class Layout {
 public:
  /// Returns the offset.
  template <typename T>
  std::uint64_t add(std::span<const T> values) {
    constexpr std::size_t kAlignment = 16;
    const std::size_t offset = bytes_;
    bytes_ += (values.size_bytes() + kAlignment - 1) / kAlignment * kAlignment;
    return offset;
  }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

 private:
  std::size_t bytes_ = 0;
};

}  // namespace

GpuPhotons::GpuPhotons(const GpuDevice& device) : device_(device), batch_(device) {
  put({});
}

void GpuPhotons::grow(std::size_t bytes) {
  if (maps_ && maps_->bytes() >= bytes) return;
  // Some more, as the next samples' maps are as large but for chance.
  const std::size_t wanted = bytes + bytes / 4;
  maps_.reset();  // frees its memory before the next one needs some
  staging_.reset();
  staging_.emplace(device_, wanted, GpuMemory::Upload);
  maps_.emplace(device_, wanted, GpuMemory::Device);
}

void GpuPhotons::put(const PhotonMaps& maps) {
  const std::array<const PhotonMap*, 4> all{&maps.caustic, &maps.global, &maps.sparse[0], &maps.sparse[1]};
  GpuPhotonMaps header;
  header.near_distance = maps.near;
  header.footprint = maps.footprint;
  Layout layout;
  layout.add(std::span<const GpuPhotonMaps>(&header, 1));
  for (std::size_t i = 0; i < all.size(); ++i) {
    const PhotonMap& map = *all.at(i);
    const PhotonCells cells = map.cells();
    GpuPhotonMap& made = header.maps.at(i);
    made.starts = layout.add(cells.starts);
    made.positions = layout.add(cells.positions);
    made.lights = layout.add(cells.lights);
    made.origin = map.space().origin;
    made.scale = map.space().scale;
    made.radius = map.radius();
    made.flux_unit = map.flux_unit();
    made.cells_per_unit = cells.per_unit;
    made.photons = static_cast<std::uint32_t>(map.size());
    made.last_slot = cells.last_slot;
    made.row_step = cells.row_step;
    made.layer_step = cells.layer_step;
  }
  grow(layout.bytes());
  std::byte* const to = staging_->mapped().data();
  const auto write = [&](auto values, std::uint64_t& where) {
    if (!values.empty()) std::memcpy(to + where, values.data(), values.size_bytes());
    where += maps_->address();  // from an offset to an address
  };
  for (std::size_t i = 0; i < all.size(); ++i) {
    const PhotonCells cells = all.at(i)->cells();
    write(cells.starts, header.maps.at(i).starts);
    write(cells.positions, header.maps.at(i).positions);
    write(cells.lights, header.maps.at(i).lights);
  }
  std::memcpy(to, &header, sizeof(header));
  batch_.copy(*staging_, *maps_, layout.bytes());
  batch_.submit();
  batch_.wait();
}

}  // namespace hpr
