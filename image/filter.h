#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <span>
#include <string_view>

#include "image/color.h"
#include "image/image.h"

/// Filters: convolution of pictures, enlargement, and the filter by which samples make up a pixel.
namespace hpr {

/// The rows of a separable filter over one channel: out(x, y) = sum over i of weights[i] in(x + i, y), summed in the
/// order of the weights. Only positions where the filter lies whole inside `in` are kept, so the result is narrower by
/// weights.size() - 1, and the caller decides how a picture continues beyond its border. `in` must be at least as wide
/// as the filter. Real is float or double.
template <typename Real>
[[nodiscard]] Image<Real> filter_rows(const Image<Real>& in, std::span<const Real> weights);

/// The columns of a separable filter: out(x, y) = sum over i of weights[i] in(x, y + i); the result is lower by
/// weights.size() - 1. See filter_rows for the rest.
template <typename Real>
[[nodiscard]] Image<Real> filter_columns(const Image<Real>& in, std::span<const Real> weights);

/// Pictures are filtered in bands of so many rows, each with the rows above and below that its filter needs: what lies
/// between two filters stays in the cache, and threads take bands.
inline constexpr int kBandRows = 64;

[[nodiscard]] constexpr std::size_t band_count(int rows) {
  return static_cast<std::size_t>((rows + kBandRows - 1) / kBandRows);
}

/// `image` on `size` pixels, neither empty: bilinear in linear light, so that every new pixel is a mean of the four
/// pixels whose centres lie about its own, and of the nearest ones beyond the centres of the outermost. An even picture
/// stays as it is, nothing gets brighter than the brightest pixel. The bits depend on the picture and the size alone.
[[nodiscard]] Image<Rgb> enlarge(const Image<Rgb>& image, Size size, int threads);

/// A rectangle of a larger picture.
struct PicturePart {
  Size whole;  ///< pixels of the picture
  Rect pixels;
};

/// The part `shown` of a picture, as enlarge() would make it of the whole one. `image`: its part `made`, before it is
/// enlarged, which has what that takes (a pixel to each side of what shows there).
[[nodiscard]] Image<Rgb> enlarge(const Image<Rgb>& image, const PicturePart& made, const PicturePart& shown,
                                 int threads);

/// How the samples of a pixel and its surroundings make up the pixel. Separable; widths in pixels.
enum class PixelFilter : std::uint8_t {
  Box,       ///< radius 0.5: the mean over the pixel
  Triangle,  ///< radius 1
  Gaussian,  ///< exp(-2 x^2), standard deviation 0.5, cut at radius 1.5
  BSpline,   ///< cubic B-spline, radius 2, variance 1/3
  Mitchell,  ///< B = C = 1/3, radius 2 (Mitchell and Netravali, "Reconstruction Filters in Computer Graphics", 1988)
};

[[nodiscard]] std::string_view name_of(PixelFilter filter);
[[nodiscard]] std::span<const PixelFilter> all_pixel_filters();
/// Throws Error (Usage) with the choices and the nearest one.
[[nodiscard]] PixelFilter parse_pixel_filter(std::string_view name);

/// A position to sample, and the weight of its radiance.
struct FilterSample {
  glm::dvec2 offset{0.0};  ///< pixels from the centre
  double weight = 1.0;     ///< 1, or -1 where the filter is negative
};

/// Importance sampling of a filter (Ernst, Stamminger, Greiner, "Filter Importance Sampling", 2006): offsets have the
/// density |f|, so that a pixel is the sum of weight times radiance over the sum of weights, and no sample belongs to
/// two pixels. `u` in [0, 1)^2; monotone in each of its components.
[[nodiscard]] FilterSample sample_filter(PixelFilter filter, const glm::dvec2& u);

/// How many samples of a (0, 2)-sequence a filter needs for the sum of weights to be positive, and to stay so. 1 where
/// no weight is negative. Mitchell's negative lobes hold 1.64 % of |f| on each side, which is less than a sixteenth:
/// of 16 such samples at most one per side and axis, 4 in all, count -1.
[[nodiscard]] int min_samples(PixelFilter filter);

}  // namespace hpr
