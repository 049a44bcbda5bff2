#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "image/tiles.h"

namespace hpr {

/// Planes of a tile's pixels, with a margin about them, so that a window about any pixel can be read as it is.
struct LenderPlanes {
  static constexpr int kMostRadius = 3;                ///< of windows
  static constexpr int kMargin = 2 * kMostRadius + 1;  ///< has room for a window that holds none of the tile's pixels
  static constexpr int kStride = kTileSide + 2 * kMargin;
  /// Rows are read as many pixels at a time as vectors are wide.
  static constexpr std::size_t kSize = std::size_t{kStride} * (kStride + 1);

  [[nodiscard]] static std::size_t index(int x, int y) {
    return static_cast<std::size_t>(y + kMargin) * kStride + static_cast<std::size_t>(x + kMargin);
  }
};

/// A vector for each pixel of a tile.
template <typename T>
struct LenderVectors {
  std::array<T, LenderPlanes::kSize> x, y, z;

  void set(std::size_t i, const glm::vec<3, T>& value) {
    x[i] = value.x;
    y[i] = value.y;
    z[i] = value.z;
  }
  [[nodiscard]] glm::vec<3, T> at(std::size_t i) const { return {x[i], y[i], z[i]}; }
};

/// What lenders and borrowers have in common: the material, and whether what it mirrors is shared apart from the rest.
[[nodiscard]] inline std::int32_t kind_of_lender(std::uint32_t material, bool is_split) {
  return static_cast<std::int32_t>(2 * material + (is_split ? 1 : 0));
}

/// What each pixel of a tile sees in one sample, as far as it tells whether light may be lent. Set for those that lend.
struct LenderSights {
  LenderSights() { lends.fill(kLendsNothing); }

  std::array<std::int32_t, LenderPlanes::kSize> lends;  ///< the kind of what lends light; else kLendsNothing
  LenderVectors<float> place;                           ///< from the eye, metres
  LenderVectors<float> normal;                          ///< interpolated
  LenderVectors<float> mapped;                          ///< the normal shaded with
  LenderVectors<float> mirrored;  ///< about the share of light that it mirrors and lets through to the eye
  LenderVectors<float> matte;     ///< and that it scatters otherwise
  std::array<float, LenderPlanes::kSize> sharpness;  ///< see Borrower

  static constexpr std::int32_t kLendsNothing = -2;
};

/// What is lent of a place's light.
enum class Lent : std::uint8_t {
  All,
  Mirrored,  ///< all that is not matte
  Matte,
};

/// A place that light is lent to by pixels about.
struct Borrower {
  std::uint32_t material = 0;
  bool is_split = false;  ///< lenders are so too; all the same to looks
  glm::vec3 place{0.0F};  ///< from the eye, metres
  glm::vec3 normal{0.0F};
  float most_apart2 = 0.0F;  ///< lenders lie nearer than its root
  float most_bent2 = 0.0F;   ///< and off their tangent plane by at most its root in distances between the two
  /// Lenders whose normal is apart from this one by the inverse of its root or more do not count; for looks, times the
  /// lender's own.
  float sharpness = 1.0F;
  float others = 1.0F;         ///< what all but the pixel itself count
  glm::vec3 weight{1.0F};      ///< about the share of light that is scattered to the eye here
  Lent lent = Lent::All;       ///< that `weight` is of
  float most_brighter = 1.0F;  ///< how many times as much one may scatter as the other
  glm::ivec2 pixel{0};         ///< of the tile
  glm::vec2 way{0.0F};         ///< from what the pixel sees, pixels
  int radius = 1;              ///< of the window
  bool is_pixel = true;        ///< what the pixel itself sees; else a look, to which lenders give as they are
};

/// What each pixel of a window gives: rows of which the first places are in use.
struct LenderWeights {
  static constexpr std::size_t kPlaces = 16;
  static constexpr std::size_t kMostRows = 2 * LenderPlanes::kMostRadius + 1;
  using Rows = std::array<float, kMostRows * kPlaces>;

  std::size_t first = 0;              ///< the window's first pixel, an index of planes
  std::size_t rows = 0;               ///< and as many columns
  alignas(32) Rows red, green, blue;  ///< set as far as there are rows
  float sum = 0.0F;                   ///< of weights before what the two scatter is made up for
};

/// Sets who lends how much to a place: a cross-bilateral filter's weights.
void weigh_lenders(const LenderSights& sights, const Borrower& borrower, LenderWeights& weights);

/// The mean of their light. `light` is 0 where nothing is lent.
[[nodiscard]] glm::dvec3 mean_of(const LenderWeights& weights, const LenderVectors<double>& light);

}  // namespace hpr
