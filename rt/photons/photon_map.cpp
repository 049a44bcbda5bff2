#include "rt/photons/photon_map.h"

#include <algorithm>
#include <bit>
#include <glm/common.hpp>
#include <utility>
#include <vector>

#include "core/error.h"
#include "rt/photons/photon_query.h"

namespace hpr {
namespace {

/// Neighbours of cells on the verge stay neighbours although cell numbers are rounded.
constexpr double kCellPerRadius = 1.0 + 1.0 / 1048576.0;

/// In ray space, where the scene's radius is in [1, 2): below it photons' own positions are too coarse.
constexpr double kMinRadius = 0x1p-24;

/// 1 / p and 1 / p^2 of the plastic number p, in 2^-32: multiples of such a pair keep furthest from whole numbers.
constexpr std::uint64_t kRowShare = 0xC13FA9A9U;
constexpr std::uint64_t kLayerShare = 0x91E10DA6U;
constexpr int kMinSlotBits = 8;

/// The words of their lights are counted by 32 bits with a sign.
constexpr std::size_t kMaxPhotons = std::size_t{1} << 29U;

/// The octahedron unfolded: a direction as x and y in [-1, 1].
glm::dvec2 unfold(const glm::dvec3& direction) {
  const double size = std::abs(direction.x) + std::abs(direction.y) + std::abs(direction.z);
  if (!(size > 0.0) || !std::isfinite(size)) return glm::dvec2(0.0);
  const double x = direction.x / size;
  const double y = direction.y / size;
  if (!(direction.z < 0.0)) return {x, y};
  return {std::copysign(1.0 - std::abs(y), x), std::copysign(1.0 - std::abs(x), y)};
}

/// The low bits of a whole number with a sign.
template <unsigned kBits>
std::uint32_t to_bits(double x) {
  constexpr double kSteps = (1U << (kBits - 1U)) - 1U;
  const auto number = static_cast<std::int32_t>(std::lround(std::clamp(x, -1.0, 1.0) * kSteps));
  return static_cast<std::uint32_t>(number) & ((1U << kBits) - 1U);
}

/// The packed normal, not of unit length.
glm::dvec3 unpack_facing(std::uint32_t packed) {
  const auto number = [](std::uint32_t bits) { return static_cast<std::int32_t>(bits << 20U) >> 20; };
  const double x = number(packed) / 2047.0;
  const double y = number(packed >> 12U) / 2047.0;
  const double z = 1.0 - std::abs(x) - std::abs(y);
  const double fold = z < 0.0 ? -z : 0.0;
  return {x - std::copysign(fold, x), y - std::copysign(fold, y), z};
}

/// A hash of the cell a photon lies in and of the side of a cube that its surface faces most.
std::uint64_t cell_hash(const Photon& photon, double cells_per_unit) {
  constexpr std::uint64_t kGolden = 0x9E3779B97F4A7C15U;  // 2^64 / the golden ratio, odd
  const glm::dvec3 facing = unpack_facing(photon.facing);
  const glm::dvec3 size = glm::abs(facing);
  const int other = size.y >= size.z ? 1 : 2;
  const int axis = size.x >= size[other] ? 0 : other;
  std::uint64_t hash = static_cast<std::uint64_t>(2 * axis + (facing[axis] < 0.0 ? 1 : 0)) * kGolden;
  for (const float coordinate : photon.position) {
    const double cell = std::floor(static_cast<double>(coordinate) * cells_per_unit);
    // NaN and what lies far out: any number serves.
    const auto number = static_cast<std::int64_t>(std::abs(cell) < 0x1p62 ? cell : 0.0);
    hash = (hash ^ static_cast<std::uint64_t>(number)) * kGolden;
    hash ^= hash >> 32U;
  }
  hash *= kGolden;
  return hash ^ (hash >> 32U);
}

bool finite(const std::array<float, 3>& v) {
  return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]);
}

}  // namespace

std::uint32_t pack_direction(const glm::dvec3& direction) {
  const glm::dvec2 at = unfold(direction);
  return to_bits<16>(at.x) | (to_bits<16>(at.y) << 16U);
}

std::uint32_t pack_facing(const glm::dvec3& normal, std::uint8_t layer) {
  const glm::dvec2 at = unfold(normal);
  return to_bits<12>(at.x) | (to_bits<12>(at.y) << 12U) | (std::uint32_t{layer} << 24U);
}

PhotonMap::PhotonMap(std::span<const Photon> photons, const RaySpace& space, double radius, double flux_unit)
    : space_(space) {
  if (!(radius > 0.0) || !std::isfinite(radius) || photons.empty()) return;
  if (photons.size() > kMaxPhotons) {
    throw Error(ExitCode::Limit, "more than 2^29 photons in one map", "send fewer photons in a pass: --photons");
  }
  const double scaled = std::max(radius * space.scale, kMinRadius);
  radius_ = scaled / space.scale;
  flux_unit_ = flux_unit;
  cells_per_unit_ = 1.0 / (scaled * kCellPerRadius);
  const int bits = std::max(static_cast<int>(std::bit_width(photons.size() - 1)), kMinSlotBits);
  slots_ = std::uint32_t{1} << static_cast<unsigned>(bits);
  row_step_ = static_cast<std::uint32_t>((kRowShare << static_cast<unsigned>(bits)) >> 32U);
  layer_step_ = static_cast<std::uint32_t>((kLayerShare << static_cast<unsigned>(bits)) >> 32U);
  sort(photons);
}

void PhotonMap::sort(std::span<const Photon> photons) {
  // A counting sort. Slot `slots_` takes photons that have no place.
  const auto slots = std::make_unique_for_overwrite<std::uint32_t[]>(photons.size());
  starts_ = std::make_unique<std::uint32_t[]>(slots_ + std::size_t{3});
  for (std::size_t i = 0; i < photons.size(); ++i) {
    const Photon& photon = photons[i];
    const glm::dvec3 cell = in_cells({photon.position[0], photon.position[1], photon.position[2]});
    const double flux = double{photon.flux[0]} + photon.flux[1] + photon.flux[2];
    slots[i] = inside(cell) && std::isfinite(flux)
                   ? slot_of(static_cast<std::uint32_t>(cell.x), static_cast<std::uint32_t>(cell.y),
                             static_cast<std::uint32_t>(cell.z))
                   : slots_;
    ++starts_[slots[i]];
  }
  size_ = photons.size() - starts_[slots_];
  const std::uint32_t again = starts_[0] + starts_[1];
  std::uint32_t before = 0;
  for (std::uint32_t slot = 0; slot < slots_; ++slot) before += std::exchange(starts_[slot], before);
  positions_ = std::make_unique_for_overwrite<PhotonPlace[]>(size_ + again + kReadBeyond);
  lights_ = std::make_unique_for_overwrite<PhotonLight[]>(size_ + again);
  constexpr std::size_t kAhead = 16;  // every photon goes to other cache lines, whose way is long
  for (std::size_t i = 0; i < photons.size(); ++i) {
    if (i + kAhead < photons.size()) {
      __builtin_prefetch(positions_.get() + starts_[slots[i + kAhead]], 1);
      __builtin_prefetch(lights_.get() + starts_[slots[i + kAhead]], 1);
    }
    if (slots[i] == slots_) continue;
    const std::uint32_t to = starts_[slots[i]]++;
    positions_[to] = {photons[i].position, photons[i].facing};
    lights_[to] = {photons[i].direction, photons[i].flux};
  }
  // Each start now stands where the next slot begins.
  std::copy_backward(starts_.get(), starts_.get() + slots_, starts_.get() + slots_ + 1);
  starts_[0] = 0;
  starts_[slots_ + 1] = starts_[slots_] + starts_[1];
  starts_[slots_ + 2] = starts_[slots_] + starts_[2];
  std::copy_n(positions_.get(), again, positions_.get() + size_);
  std::copy_n(lights_.get(), again, lights_.get() + size_);
  std::fill_n(positions_.get() + size_ + again, kReadBeyond, PhotonPlace{});
}

PhotonCells PhotonMap::cells() const {
  if (size_ == 0) return {};
  const std::size_t stored = starts_[slots_ + std::size_t{2}];
  return {{starts_.get(), slots_ + std::size_t{3}},
          {positions_.get(), stored},
          {lights_.get(), stored},
          cells_per_unit_,
          slots_ - 1,
          row_step_,
          layer_step_};
}

double PhotonMap::density(double radius) const {
  return radius > 0.0 ? 2.0 / (std::numbers::pi * radius * radius) * flux_unit_ : 0.0;
}

void PhotonMap::find(const glm::dvec3& position, const glm::dvec3& normal, std::uint8_t layer, double radius,
                     FoundPhotons& found) const {
  found.count = 0;
  if (size_ == 0) return;
  PhotonSearch search;
  search.position = space_.from_world(position);
  const glm::dvec3 cell = in_cells(search.position);
  if (!inside(cell)) return;
  const auto x = static_cast<std::uint32_t>(cell.x);
  const auto y = static_cast<std::uint32_t>(cell.y);
  const auto z = static_cast<std::uint32_t>(cell.z);
  search.in_cell = cell - glm::dvec3(x, y, z);
  search.cell = x + y * row_step_ + z * layer_step_;
  search.row_step = row_step_;
  search.layer_step = layer_step_;
  search.last_slot = slots_ - 1;
  search.normal = normal;
  search.layer = layer;
  const double scaled = std::max(radius * space_.scale, kMinRadius);
  search.radius2 = scaled * scaled;
  search.inverse_radius2 = 1.0 / search.radius2;
  search.cells_per_unit = cells_per_unit_;
  search.flatness = kFlatness * scaled + 2.0 * kFloatStep;  // what float positions may stray from their plane
  search.min_cosine2 = kMinCosine2;
  find_photons(search, starts_.get(), positions_.get(), found);
}

double progressive_radius(double first, std::uint64_t pass) {
  constexpr double kAlpha = 2.0 / 3.0;
  double area = 1.0;
  for (std::uint64_t k = 1; k <= pass; ++k) area *= (static_cast<double>(k) + kAlpha) / (static_cast<double>(k) + 1.0);
  return first * std::sqrt(area);
}

double first_radius(std::span<const Photon> photons, const RaySpace& space, double wanted) {
  const double most = 0.1 * space.radius;
  constexpr std::size_t kMaxThinned = 32768;
  constexpr std::size_t kProbes = 127;
  const std::size_t stride = photons.size() / kMaxThinned + 1;
  std::vector<glm::vec3> positions;
  for (std::size_t i = 0; i < photons.size(); i += stride) {
    const auto& p = photons[i].position;
    if (finite(p)) positions.emplace_back(p[0], p[1], p[2]);
  }
  const auto thinning = static_cast<double>(stride);
  const auto k = static_cast<std::size_t>(std::clamp(wanted / thinning, 1.0, static_cast<double>(positions.size())));
  if (positions.size() < 2 || k >= positions.size()) return most / space.scale;
  const std::size_t step = std::max<std::size_t>(positions.size() / kProbes, 1);
  std::vector<double> areas;  // of the circles about some of them that take in k others, over pi
  std::vector<float> distances2(positions.size());
  for (std::size_t probe = 0; probe < positions.size(); probe += step) {
    for (std::size_t i = 0; i < positions.size(); ++i) {
      const glm::vec3 offset = positions[i] - positions[probe];
      distances2[i] = glm::dot(offset, offset);
    }
    const auto kth = distances2.begin() + static_cast<std::ptrdiff_t>(k);  // the nearest is the probe itself
    std::ranges::nth_element(distances2, kth);
    areas.push_back(*kth);
  }
  const auto median = areas.begin() + static_cast<std::ptrdiff_t>(areas.size() / 2);
  std::ranges::nth_element(areas, median);
  // The circle that takes in k of evenly scattered points follows a gamma distribution, whose median is k - 1/3.
  const double area_of_one = *median / (static_cast<double>(k) - 1.0 / 3.0) / thinning;
  const double radius = std::sqrt(wanted * area_of_one);
  return (radius > 0.0 ? std::min(radius, most) : most) / space.scale;
}

double PhotonMaps::sparse_radius(const PhotonMap& map, double distance, double pdf) const {
  const double narrow = pdf > 0.0 ? std::min(1.0, 1.0 / std::sqrt(std::numbers::pi * pdf)) : 1.0;
  return std::clamp(footprint * distance * narrow, std::min(global.radius(), map.radius()), map.radius());
}

std::vector<Photon> extract_sparse(std::vector<Photon>& photons, const RaySpace& space, double width,
                                   std::uint32_t few) {
  const double cells_per_unit = 1.0 / (width * space.scale);
  // A table with open addressing, half of it used at the most. Cells of one hash are one cell to it.
  struct Cell {
    std::uint32_t hash = 0;
    std::uint32_t photons = 0;
  };
  const auto bits = static_cast<unsigned>(std::bit_width(2 * photons.size() + 1));
  std::vector<Cell> cells(std::size_t{1} << bits);
  std::vector<std::uint32_t> cell_of(photons.size());
  for (std::size_t i = 0; i < photons.size(); ++i) {
    const std::uint64_t hash = cell_hash(photons[i], cells_per_unit);
    const auto low = static_cast<std::uint32_t>(hash);
    std::size_t slot = hash >> (64U - bits);
    while (cells[slot].photons > 0 && cells[slot].hash != low) slot = (slot + 1) % cells.size();
    cells[slot].hash = low;
    ++cells[slot].photons;
    cell_of[i] = static_cast<std::uint32_t>(slot);
  }
  std::vector<Photon> sparse;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < photons.size(); ++i) {
    if (cells[cell_of[i]].photons < few) {
      sparse.push_back(photons[i]);
    } else {
      photons[kept++] = photons[i];
    }
  }
  photons.resize(kept);
  return sparse;
}

}  // namespace hpr
