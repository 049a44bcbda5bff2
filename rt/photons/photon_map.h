#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <numbers>
#include <span>
#include <vector>

#include "rt/trace/ray_scene.h"

namespace hpr {

/// A direction in 32 bits: the octahedron unfolded onto a square (Meyer, Suessmuth, Sussner, Stamminger, Greiner, "On
/// Floating-Point Normal Vectors", 2010), 16 bits a side. Off by 7e-5 rad at most; +z for vectors without direction.
[[nodiscard]] std::uint32_t pack_direction(const glm::dvec3& direction);

/// The packed direction, not of unit length (between 0.57 and 1): enough for signs and ratios.
[[nodiscard]] inline glm::dvec3 unpack_unscaled(std::uint32_t packed) {
  const double x = static_cast<std::int16_t>(packed & 0xFFFFU) * (1.0 / 32767.0);
  const double y = static_cast<std::int16_t>(packed >> 16U) * (1.0 / 32767.0);
  const double z = 1.0 - std::abs(x) - std::abs(y);
  const double fold = z < 0.0 ? -z : 0.0;
  return {x - std::copysign(fold, x), y - std::copysign(fold, y), z};
}
[[nodiscard]] inline glm::dvec3 unpack_direction(std::uint32_t packed) {
  return glm::normalize(unpack_unscaled(packed));
}

/// A normal and a layer in 32 bits, 12 for each side of the octahedron: off by 1.2e-3 rad at most.
[[nodiscard]] std::uint32_t pack_facing(const glm::dvec3& normal, std::uint8_t layer = 0);

/// Light that has arrived on a surface. As it is sent between ranks.
struct Photon {
  std::array<float, 3> position{};  ///< ray space
  std::uint32_t facing = 0;         ///< packed: the geometric normal on the side it arrived on, and SurfacePoint::layer
  std::uint32_t direction = 0;      ///< packed: towards where it came from
  std::array<float, 3> flux{};      ///< in PhotonSettings::flux_unit
  float traveled = 0.0F;            ///< metres since it was scattered last

  bool operator==(const Photon&) const = default;
};
static_assert(sizeof(Photon) == 36);

/// The light of a photon of a map.
struct PhotonLight {
  std::uint32_t direction = 0;  ///< packed: towards where it came from
  std::array<float, 3> flux{};  ///< in the map's unit
};
static_assert(sizeof(PhotonLight) == 16);

/// Where a photon of a map lies, in ray space.
struct PhotonPlace {
  std::array<float, 3> position{};
  std::uint32_t facing = 0;  ///< packed, see Photon
};
static_assert(sizeof(PhotonPlace) == 16);

/// Photons a gather has found: to be used anew for the next, as growing takes time.
struct FoundPhotons {
  std::size_t count = 0;
  std::vector<std::uint32_t> index;  ///< of the map's; `count` of them
  std::vector<float> weight;         ///< of each
};

/// So many places behind the last one may be read.
inline constexpr std::size_t kReadBeyond = 16;

/// The cells of a map and what lies in them, as find_photons reads them: for devices that search it by themselves.
struct PhotonCells {
  std::span<const std::uint32_t> starts;
  std::span<const PhotonPlace> positions;  ///< those of the first two slots are there twice
  std::span<const PhotonLight> lights;
  double per_unit = 0.0;  ///< in ray space
  std::uint32_t last_slot = 0;
  std::uint32_t row_step = 0;
  std::uint32_t layer_step = 0;
};

/// Photons in a hash grid whose cells are as wide as the gather radius: with one radius for a whole map, as progressive
/// photon mapping has it (Knaus and Zwicker, "Progressive Photon Mapping: A Probabilistic Approach", 2011), a gather
/// looks at 3 x 3 rows of cells.
///
/// The photons lie sorted by cell, inside a cell in the order they were given, and sums run in that order: they depend
/// on the photons and the radius alone.
class PhotonMap {
 public:
  /// No photons.
  PhotonMap() = default;

  /// `radius` in metres; not positive, not a number or infinite: the map stays empty. Photons whose position or flux is
  /// not finite are left out. `flux_unit`: that of their flux, W. Throws Error (Limit) past 2^29 photons.
  PhotonMap(std::span<const Photon> photons, const RaySpace& space, double radius, double flux_unit = 1.0);

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] double radius() const { return radius_; }

  /// The photons whose density about `position` (world) on the surface with `normal` (unit length, geometric) counts:
  /// that lie within the radius, within kFlatness of it off the tangent plane, and on a surface of the same layer
  /// turned by less than 60 degrees from this one. None for places without photons, far away, or not finite.
  ///
  /// They are weighted by Epanechnikov's kernel 2 / (pi r^2) (1 - d^2 / r^2), of which density() is the factor: of all
  /// kernels the one with the least mean squared error (Epanechnikov 1969), no root is needed, and it falls to zero at
  /// the rim, so that what lies there matters little and pictures are continuous.
  void find(const glm::dvec3& position, const glm::dvec3& normal, std::uint8_t layer, FoundPhotons& found) const {
    find(position, normal, layer, radius_, found);
  }
  /// Within `radius` metres, at most the map's own.
  void find(const glm::dvec3& position, const glm::dvec3& normal, std::uint8_t layer, double radius,
            FoundPhotons& found) const;

  /// W/m^2 per flux unit: times this, the sum of the weights and fluxes found within `radius` is an irradiance.
  [[nodiscard]] double density(double radius) const;

  /// By FoundPhotons::index.
  [[nodiscard]] const PhotonLight* lights() const { return lights_.get(); }

  /// Empty where the map is. The map must outlive it, unchanged.
  [[nodiscard]] PhotonCells cells() const;
  [[nodiscard]] const RaySpace& space() const { return space_; }
  /// W
  [[nodiscard]] double flux_unit() const { return flux_unit_; }

  /// The photons' density there on layer 0, each weighted by its flux and `value(direction)`, a glm::dvec3 for the unit
  /// direction it came from: irradiance in W/m^2 for a value of 1, reflected radiance for that of a BRDF (flux density
  /// holds the cosine).
  template <typename Value>
  [[nodiscard]] glm::dvec3 gather(const glm::dvec3& position, const glm::dvec3& normal, Value&& value) const {
    FoundPhotons found;
    find(position, normal, 0, found);
    glm::dvec3 sum(0.0);
    for (std::size_t i = 0; i < found.count; ++i) {
      const PhotonLight& light = lights_[found.index[i]];
      const glm::dvec3 flux(light.flux[0], light.flux[1], light.flux[2]);
      sum += static_cast<double>(found.weight[i]) * flux * value(unpack_direction(light.direction));
    }
    return sum * density(radius_);
  }

  /// How many photons such a gather counts.
  [[nodiscard]] std::size_t count(const glm::dvec3& position, const glm::dvec3& normal) const {
    FoundPhotons found;
    find(position, normal, 0, found);
    return found.count;
  }

  /// A share of the radius, so that a map means the same at any scale; wide enough for a sphere of 2.5 radii.
  static constexpr double kFlatness = 0.2;

 private:
  /// Cells are counted from a corner far outside the scene, so that all numbers are positive.
  [[nodiscard]] glm::dvec3 in_cells(const glm::dvec3& at) const { return at * cells_per_unit_ + kMiddle; }
  /// False for places beyond the grid, or not finite: comparisons with NaN are false.
  [[nodiscard]] static bool inside(const glm::dvec3& cell) {
    return cell.x > 1.0 && cell.x < kLast && cell.y > 1.0 && cell.y < kLast && cell.z > 1.0 && cell.z < kLast;
  }

  /// Rows along x keep their cells side by side, and rows are spread by a lattice (Roberts's plastic-number sequence in
  /// two dimensions): cells that share a slot lie far apart, and of the 3 x 3 rows a gather looks at no two overlap, so
  /// that no photon is met twice.
  [[nodiscard]] std::uint32_t slot_of(std::uint32_t x, std::uint32_t y, std::uint32_t z) const {
    return (x + y * row_step_ + z * layer_step_) & (slots_ - 1);
  }

  static constexpr double kMiddle = 1073741824.0;  // 2^30 cells each way
  static constexpr double kLast = 2.0 * kMiddle - 2.0;
  static constexpr double kMinCosine2 = 0.25;

  void sort(std::span<const Photon> photons);

  RaySpace space_;
  std::size_t size_ = 0;
  double radius_ = 0.0;
  double flux_unit_ = 1.0;
  double cells_per_unit_ = 0.0;  ///< in ray space

  std::uint32_t slots_ = 0;  ///< a power of two
  std::uint32_t row_step_ = 0;
  std::uint32_t layer_step_ = 0;
  // By slot; those of the first two slots stand once more behind the last, so that runs need not wrap around.
  std::unique_ptr<PhotonPlace[]> positions_;  ///< and kReadBeyond more
  std::unique_ptr<PhotonLight[]> lights_;
  std::unique_ptr<std::uint32_t[]> starts_;  ///< [slots_ + 3]: where each slot's photons begin
};

/// The photons of one sample, ready to be gathered.
struct PhotonMaps {
  PhotonMap caustic;
  PhotonMap global;   ///< less the photons that come from nearer than that:
  double near = 0.0;  ///< metres; 0: all photons are there
  /// The global photons that lie where few do and where fewer do, in place of `global`; see sparse_radius().
  std::array<PhotonMap, 2> sparse;
  double footprint = 0.0;  ///< radians about a ray of a direction chosen by the cosine that its footprint covers

  /// The radius in which the photons of `map`, one of the sparse ones, are looked up at a place that a ray reached:
  /// within `global`'s own they would be met so seldom that one makes a pixel bright. As wide as the ray's footprint
  /// allows, `distance` metres long and of a direction chosen with density `pdf` per solid angle (0: the only one), and
  /// no wider than the map's.
  [[nodiscard]] double sparse_radius(const PhotonMap& map, double distance, double pdf) const;
};

/// Moves out of `photons` those that are fewer than `few` in their cell of a grid `width` metres wide, of those whose
/// surfaces face about the same way. Which these are does not depend on their light, so the light of both parts, each
/// spread as far as suits it, is that of all.
[[nodiscard]] std::vector<Photon> extract_sparse(std::vector<Photon>& photons, const RaySpace& space, double width,
                                                 std::uint32_t few);

/// Radius of pass `pass` (from 0) of a progressive estimate: r_i^2 = r_0^2 prod_{k=1..i} (k + a) / (k + 1), a = 2/3
/// (Knaus and Zwicker 2011, equation 15: variance and expected error of the passes' mean both vanish). Steps: `pass`.
[[nodiscard]] double progressive_radius(double first, std::uint64_t pass);

/// A first radius in metres that takes in about `wanted` photons where they lie dense: from the distance to the k-th
/// neighbour, in the median over some of the photons, thinned out evenly to a number that bounds the time. That is
/// sqrt(wanted A / (pi N)) for N photons spread over an area A. Never more than a tenth of the scene's radius, which
/// it is for fewer than two photons.
[[nodiscard]] double first_radius(std::span<const Photon> photons, const RaySpace& space, double wanted = 50.0);

}  // namespace hpr
