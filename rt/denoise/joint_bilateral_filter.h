#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <type_traits>
#include <vector>

#include "image/tiles.h"

/// A joint (cross) bilateral filter over the pixels of one tile (Eisemann, Durand, "Flash Photography Enhancement via
/// Intrinsic Relighting", 2004; Kopf, Cohen, Lischinski, Uyttendaele, "Joint Bilateral Upsampling", 2007): light at a
/// center is the weighted mean of the light at neighbor taps that show the same material at about the same place,
/// turned about alike, each multiplied by the ratio of the scattered fractions of the two, so that textures stay. The
/// denoiser filters in single precision with smooth falloffs; half-resolution shading upsamples in double precision
/// with a box.
namespace hpr {

/// Planes of the taps of a tile, with a margin about them, so that a window about any pixel can be read as it is.
struct TapPlanes {
  static constexpr int kMaxRadius = 3;                ///< of windows
  static constexpr int kMargin = 2 * kMaxRadius + 1;  ///< has room for a window that holds none of the tile's pixels
  static constexpr int kStride = kTileSide + 2 * kMargin;
  /// Rows are read as many taps at a time as SIMD vectors are wide.
  static constexpr std::size_t kSize = std::size_t{kStride} * (kStride + 1);

  [[nodiscard]] static std::size_t index(int x, int y) {
    return static_cast<std::size_t>(y + kMargin) * kStride + static_cast<std::size_t>(x + kMargin);
  }
  [[nodiscard]] static glm::ivec2 pixel_at(std::size_t i) {
    return {static_cast<int>(i % kStride) - kMargin, static_cast<int>(i / kStride) - kMargin};
  }
};

/// A vector for each tap of a tile.
template <typename T>
struct TapVectors {
  std::array<T, TapPlanes::kSize> x, y, z;

  void set(std::size_t i, const glm::vec<3, T>& value) {
    x[i] = value.x;
    y[i] = value.y;
    z[i] = value.z;
  }
  [[nodiscard]] glm::vec<3, T> at(std::size_t i) const { return {x[i], y[i], z[i]}; }
};

/// What a tap and a center must have in common: the material, and whether diffuse light is filtered apart from specular
/// light.
[[nodiscard]] inline std::int32_t tap_kind(std::uint32_t material, bool separate_diffuse) {
  return static_cast<std::int32_t>(2 * material + (separate_diffuse ? 1 : 0));
}

/// The surfaces that the taps of a tile show in one sample. `T` is float or double.
template <typename T>
struct NeighborFeatures {
  /// As wide as T, so that SIMD lanes match.
  using Kind = std::conditional_t<sizeof(T) == 8, std::int64_t, std::int32_t>;
  static constexpr Kind kNoTap = -2;

  NeighborFeatures() { kinds.fill(kNoTap); }

  std::array<Kind, TapPlanes::kSize> kinds;  ///< tap_kind, or kNoTap; where that is, the other planes mean nothing
  TapVectors<T> position;                    ///< metres, relative to whatever FilterCenter::position is
  TapVectors<T> normal;                      ///< interpolated
  TapVectors<T> shading_normal;
  std::array<T, TapPlanes::kSize> sharpness;  ///< multiplies FilterCenter::sharpness of subpixel samples
  std::vector<TapVectors<T>> scattering;      ///< fractions of light scattered to the eye, see ScatteringTerm
};

/// Light is scaled by own / NeighborFeatures::scattering[plane]; taps whose ratio is out of bounds have no weight.
template <typename T>
struct ScatteringTerm {
  std::size_t plane = 0;
  glm::vec<3, T> own{1};  ///< about the fraction of light that the center scatters to the eye
};

/// The taps that may have a weight.
struct FilterWindow {
  glm::ivec2 first{0};  ///< upper left, of the tile; may lie in the margin
  int columns = 1;
  int rows = 1;
};

/// The square window of so many taps about a place near a pixel. Windows that lie outside the tile are moved next to
/// it.
[[nodiscard]] FilterWindow window_about(const glm::ivec2& pixel, const glm::vec2& offset, int radius);

/// A place that light is filtered for.
template <typename T>
struct FilterCenter {
  static constexpr std::size_t kMaxTerms = 8;

  std::uint32_t material = 0;
  bool separate_diffuse = false;  ///< taps must be so too; subpixel samples take either
  glm::vec<3, T> position{0};     ///< metres
  glm::vec<3, T> normal{0};
  T max_distance2 = 0;  ///< taps lie no farther away than its root, metres
  T max_bend2 = 0;      ///< and off their tangent plane by at most its root in distances between the two
  /// Taps whose normal differs from this one by the inverse of its root or more have no weight.
  T sharpness = 1;
  T neighbor_weight = 1;                                ///< of all taps but the pixel itself
  std::array<ScatteringTerm<T>, kMaxTerms> terms = {};  ///< of which the first `term_count` are in use
  std::size_t term_count = 0;                           ///< 0: light is taken as it is
  T max_ratio = 1;
  T min_ratio = 0;
  glm::ivec2 pixel{0};     ///< of the tile
  glm::vec2 offset{0.0F};  ///< pixels, from what the pixel's own sample shows
  FilterWindow window = {};
  T reach = 1;          ///< pixels from the center to where the spatial kernel ends
  bool is_box = false;  ///< taps weigh 1 or nothing: neither distance on the screen nor normals fade them
  bool is_pixel =
      true;  ///< what the pixel itself shows, by shading normals; else a subpixel sample, by interpolated ones
};

/// The weight of each tap of a window, by row of kPlaces, for each of the center's terms (one where it has none).
template <typename T>
struct TapWeights {
  static constexpr std::size_t kPlaces = 16;
  static constexpr std::size_t kMaxRows = 2 * TapPlanes::kMaxRadius + 1;
  using Rows = std::array<T, kMaxRows * kPlaces>;
  struct Channels {
    alignas(32) Rows red, green, blue;  ///< set as far as there are rows
  };

  std::size_t first = 0;  ///< the window's first tap, an index of planes
  std::size_t columns = 0;
  std::size_t rows = 0;
  std::array<Channels, FilterCenter<T>::kMaxTerms> terms;
  T sum = 0;  ///< of the weights before they are multiplied by ratios; 0: no tap has any
};

/// Sets the weights of the taps in the center's window.
void joint_bilateral_weights(const NeighborFeatures<float>& taps, const FilterCenter<float>& center,
                             TapWeights<float>& weights);
void joint_bilateral_weights(const NeighborFeatures<double>& taps, const FilterCenter<double>& center,
                             TapWeights<double>& weights);

/// The mean of the taps' light by the weights of the first term. `light` is 0 where there is no tap.
[[nodiscard]] glm::dvec3 filtered_mean(const TapWeights<float>& weights, const TapVectors<double>& light);

/// The mean of light(i), a glm::dvec3, by the weights of a term, where few taps of the window have any: row after row.
/// i is the index of planes.
template <typename Light>
[[nodiscard]] glm::dvec3 filtered_mean(const TapWeights<double>& weights, std::size_t term, const Light& light) {
  const auto& channels = weights.terms.at(term);
  glm::dvec3 sum(0.0);
  for (std::size_t row = 0; row < weights.rows; ++row) {
    for (std::size_t column = 0; column < weights.columns; ++column) {
      const std::size_t at = row * TapWeights<double>::kPlaces + column;
      const glm::dvec3 weight(channels.red[at], channels.green[at], channels.blue[at]);
      if (weight != glm::dvec3(0.0)) sum += weight * light(weights.first + row * TapPlanes::kStride + column);
    }
  }
  return sum / weights.sum;
}

}  // namespace hpr
