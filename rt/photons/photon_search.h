#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

namespace hpr {

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
  std::vector<float> weight;         ///< likewise
};

/// Photons about a place on a surface, in ray space.
struct PhotonSearch {
  glm::dvec3 place{0.0};
  glm::dvec3 in_cell{0.0};  ///< where in its cell it lies, each in [0, 1)
  std::uint32_t cell = 0;   ///< where that would be in the order of cells, not yet wrapped around
  std::uint32_t row_step = 0;
  std::uint32_t layer_step = 0;
  std::uint32_t last_slot = 0;  ///< as many slots as a power of two, less one
  glm::dvec3 normal{0.0};       ///< of the surface, unit length
  std::uint8_t layer = 0;       ///< photons count of the same,
  double radius2 = 0.0;         ///< photons count that lie nearer than its root,
  double inverse_radius2 = 0.0;
  double cells_per_unit = 0.0;
  double flatness = 0.0;       ///< so much off the plane at the most,
  double least_cosine2 = 0.0;  ///< and on surfaces whose normal has a cosine to this one of at least its root
};

/// So many places behind the last one may be read.
inline constexpr std::size_t kReadBeyond = 16;

/// Finds the photons that count in the 3 x 3 rows of cells about a place, with Epanechnikov's weight 1 - d^2 / r^2: row
/// after row, cut to the cells that come within the radius and within the flatness of the plane. Cell x of row y of
/// layer z stands at slot (x + y row_step + z layer_step) & last_slot; starts[slot] is where its photons begin in
/// `places`, also for the first two slots behind the last. In single precision, in steps that no processor rounds
/// otherwise.
void find_photons(const PhotonSearch& search, const std::uint32_t* starts, const PhotonPlace* places,
                  FoundPhotons& found);

}  // namespace hpr
