#include "image/flip.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <numbers>
#include <numeric>
#include <vector>

#include "core/parallel.h"
#include "image/color.h"
#include "image/filter.h"
#include "image/metrics.h"

namespace hpr {
namespace {

using Weights = std::vector<float>;

// Colour spaces. XYZ is always relative to the white of the display, so that (1, 1, 1) is white.

/// IEC 61966-2-1's matrix, its rows divided by their sums. GLM's constructors take columns.
const glm::mat3& rgb_to_xyz() {
  static const glm::mat3 matrix = [] {
    glm::dmat3 rows{{0.4124, 0.3576, 0.1805}, {0.2126, 0.7152, 0.0722}, {0.0193, 0.1192, 0.9505}};
    for (int row = 0; row < 3; ++row) rows[row] /= rows[row].x + rows[row].y + rows[row].z;
    return glm::mat3(glm::transpose(rows));
  }();
  return matrix;
}

const glm::mat3& xyz_to_rgb() {
  static const glm::mat3 matrix(glm::inverse(glm::dmat3(rgb_to_xyz())));
  return matrix;
}

/// YCxCz: CIELab made linear, in which the blur of the eye is a filter.
glm::vec3 xyz_to_opponent(const glm::vec3& xyz) {
  return {116.0F * xyz.y - 16.0F, 500.0F * (xyz.x - xyz.y), 200.0F * (xyz.y - xyz.z)};
}

glm::vec3 opponent_to_xyz(const glm::vec3& opponent) {
  const float y = (opponent.x + 16.0F) / 116.0F;
  return {y + opponent.y / 500.0F, y, y - opponent.z / 200.0F};
}

float lab_curve(float t) {
  constexpr float kDelta = 6.0F / 29.0F;
  return t > kDelta * kDelta * kDelta ? std::cbrt(t) : t / (3.0F * kDelta * kDelta) + 4.0F / 29.0F;
}

/// CIELab with its colourfulness scaled by lightness, after Hunt: colours look paler in the dark.
glm::vec3 hunt_lab(const glm::vec3& rgb) {
  const glm::vec3 xyz = rgb_to_xyz() * rgb;
  const glm::vec3 f{lab_curve(xyz.x), lab_curve(xyz.y), lab_curve(xyz.z)};
  const float lightness = 116.0F * f.y - 16.0F;
  return {lightness, 0.01F * lightness * 500.0F * (f.x - f.y), 0.01F * lightness * 200.0F * (f.y - f.z)};
}

/// HyAB: city blocks in lightness, as the crow flies in chroma; raised to a power that compresses large distances.
float color_distance(const glm::vec3& rgb_a, const glm::vec3& rgb_b) {
  const glm::vec3 apart = hunt_lab(rgb_a) - hunt_lab(rgb_b);
  return std::pow(std::abs(apart.x) + std::hypot(apart.y, apart.z), 0.7F);
}

/// The first 40 % of what distances can be, between green and blue, fill 95 % of the errors.
float color_error(const glm::vec3& rgb_a, const glm::vec3& rgb_b) {
  static const float largest = color_distance({0, 1, 0}, {0, 0, 1});
  constexpr float kError = 0.95F;
  const float knee = 0.4F * largest;
  const float distance = color_distance(rgb_a, rgb_b);
  if (distance < knee) return kError / knee * distance;
  return kError + (distance - knee) / (largest - knee) * (1.0F - kError);
}

/// Filters of equal length, 2 radius + 1. Those of the eye are normalised Gaussians; the yellow-blue channel's is the
/// sum of two, whose shares stand in the columns' weights.
struct Filters {
  int radius = 0;
  Weights luminance, red_green, yellow_blue_narrow, yellow_blue_wide;
  Weights yellow_blue_narrow_fraction, yellow_blue_wide_fraction;
  Weights smooth, edge, point;  ///< for features: a Gaussian and its first and second derivative
};

/// value(x) for x in pixels from the centre, 0 beyond `support`.
template <typename Function>
Weights sampled(int radius, int support, Function value) {
  Weights weights;
  for (int x = -radius; x <= radius; ++x)
    weights.push_back(std::abs(x) <= support ? static_cast<float>(value(x)) : 0.0F);
  return weights;
}

Weights scaled(Weights weights, double factor) {
  for (float& weight : weights) weight = static_cast<float>(static_cast<double>(weight) * factor);
  return weights;
}

/// Positive weights scaled to the sum 1 and negative ones to -1.
Weights balanced(Weights weights) {
  double positive = 0.0;
  double negative = 0.0;
  for (const float weight : weights) (weight > 0.0F ? positive : negative) += std::abs(static_cast<double>(weight));
  for (float& weight : weights) {
    if (weight == 0.0F) continue;
    weight = static_cast<float>(static_cast<double>(weight) / (weight > 0.0F ? positive : negative));
  }
  return weights;
}

/// The eye's contrast sensitivity is a sum of terms a sqrt(pi / b) exp(-(pi x)^2 / b), x in degrees.
struct Sensitivity {
  double a;
  double b;
};
constexpr Sensitivity kLuminance{1.0, 0.0047};
constexpr Sensitivity kRedGreen{1.0, 0.0053};
constexpr Sensitivity kYellowBlueNarrow{34.1, 0.04};
constexpr Sensitivity kYellowBlueWide{13.5, 0.025};

Filters make_filters(double pixels_per_degree) {
  constexpr double kPi = std::numbers::pi;
  constexpr double kFeatureDegrees = 0.082;  // the width of the features the eye finds best
  const double widest = std::sqrt(kYellowBlueNarrow.b / (2.0 * kPi * kPi));
  const double sigma = 0.5 * kFeatureDegrees * pixels_per_degree;
  const int support = static_cast<int>(std::ceil(3.0 * sigma));
  Filters filters;
  filters.radius = std::max(support, static_cast<int>(std::ceil(3.0 * widest * pixels_per_degree)));

  const auto term = [&](const Sensitivity& s) {
    return sampled(filters.radius, filters.radius, [&](int x) {
      const double degrees = x / pixels_per_degree;
      return std::exp(-kPi * kPi * degrees * degrees / s.b);
    });
  };
  filters.luminance = balanced(term(kLuminance));
  filters.red_green = balanced(term(kRedGreen));
  filters.yellow_blue_narrow = balanced(term(kYellowBlueNarrow));
  filters.yellow_blue_wide = balanced(term(kYellowBlueWide));
  const auto volume = [&](const Sensitivity& s) {
    const Weights weights = term(s);
    const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
    return s.a * std::sqrt(kPi / s.b) * sum * sum;
  };
  const double narrow = volume(kYellowBlueNarrow);
  const double wide = volume(kYellowBlueWide);
  filters.yellow_blue_narrow_fraction = scaled(filters.yellow_blue_narrow, narrow / (narrow + wide));
  filters.yellow_blue_wide_fraction = scaled(filters.yellow_blue_wide, wide / (narrow + wide));

  const auto bell = [&](int x) { return std::exp(-0.5 * x * x / (sigma * sigma)); };
  filters.smooth = balanced(sampled(filters.radius, support, bell));
  filters.edge = balanced(sampled(filters.radius, support, [&](int x) { return x * bell(x); }));
  filters.point =
      balanced(sampled(filters.radius, support, [&](int x) { return (x * x / (sigma * sigma) - 1.0) * bell(x); }));
  return filters;
}

/// The filtered rows of one picture that are compared.
struct FilteredRows {
  std::array<Image<float>, 3> opponent;  ///< after the eye's blur
  Image<float> edges, points;            ///< how strong
};

/// YCxCz of `rows` rows from `top` on, which may reach beyond the picture, with `radius` pixels more at either side.
std::array<Image<float>, 3> opponent_of(std::span<const float> picture, Size size, int top, int rows, int radius) {
  const Size padded{size.width + 2 * radius, rows};
  std::array<Image<float>, 3> planes{Image<float>(padded), Image<float>(padded), Image<float>(padded)};
  for (int row = 0; row < rows; ++row) {
    const auto y = static_cast<std::size_t>(std::clamp(top + row, 0, size.height - 1));
    const std::span<const float> values = picture.subspan(y * static_cast<std::size_t>(size.width) * 3);
    for (int x = 0; x < size.width; ++x) {
      const float* const v = &values[static_cast<std::size_t>(x) * 3];
      const glm::vec3 opponent =
          xyz_to_opponent(rgb_to_xyz() * glm::vec3(decode_srgb(v[0]), decode_srgb(v[1]), decode_srgb(v[2])));
      for (int channel = 0; channel < 3; ++channel) {
        planes[static_cast<std::size_t>(channel)].at(x + radius, row) = opponent[channel];
      }
    }
    for (Image<float>& plane : planes) {
      const std::span<float> all = plane.row(row);
      const auto border = static_cast<std::size_t>(radius);
      std::ranges::fill(all.first(border), all[border]);
      std::ranges::fill(all.last(border), all[all.size() - border - 1]);
    }
  }
  return planes;
}

Image<float> filtered(const Image<float>& plane, const Weights& along_x, const Weights& along_y) {
  return filter_columns<float>(filter_rows<float>(plane, along_x), along_y);
}

/// The length of the vector that `across` finds along x and along y.
Image<float> feature(const Image<float>& luminance, const Image<float>& smooth_rows, const Weights& across,
                     const Weights& smooth) {
  Image<float> strength = filtered(luminance, across, smooth);
  const Image<float> along_y = filter_columns<float>(smooth_rows, across);
  for (std::size_t i = 0; i < strength.pixels().size(); ++i) {
    const float x = strength.pixels()[i];
    const float y = along_y.pixels()[i];
    // Luminance is 116 times as large here as where features are defined, from 0 to 1.
    strength.pixels()[i] = std::sqrt(x * x + y * y) / 116.0F;
  }
  return strength;
}

FilteredRows filter_picture(std::span<const float> picture, Size size, int top, int rows, const Filters& f) {
  const auto planes = opponent_of(picture, size, top - f.radius, rows + 2 * f.radius, f.radius);
  FilteredRows filtered_rows;
  filtered_rows.opponent[0] = filtered(planes[0], f.luminance, f.luminance);
  filtered_rows.opponent[1] = filtered(planes[1], f.red_green, f.red_green);
  filtered_rows.opponent[2] = filtered(planes[2], f.yellow_blue_narrow, f.yellow_blue_narrow_fraction);
  const Image<float> wide = filtered(planes[2], f.yellow_blue_wide, f.yellow_blue_wide_fraction);
  for (std::size_t i = 0; i < wide.pixels().size(); ++i) filtered_rows.opponent[2].pixels()[i] += wide.pixels()[i];
  const Image<float> smooth_rows = filter_rows<float>(planes[0], f.smooth);
  filtered_rows.edges = feature(planes[0], smooth_rows, f.edge, f.smooth);
  filtered_rows.points = feature(planes[0], smooth_rows, f.point, f.smooth);
  return filtered_rows;
}

glm::vec3 blurred_color(const FilteredRows& filtered_rows, std::size_t i) {
  const glm::vec3 opponent{filtered_rows.opponent[0].pixels()[i], filtered_rows.opponent[1].pixels()[i],
                           filtered_rows.opponent[2].pixels()[i]};
  return glm::clamp(xyz_to_rgb() * opponent_to_xyz(opponent), 0.0F, 1.0F);
}

float error_at(const FilteredRows& a, const FilteredRows& b, std::size_t i) {
  const float edges = std::abs(a.edges.pixels()[i] - b.edges.pixels()[i]);
  const float points = std::abs(a.points.pixels()[i] - b.points.pixels()[i]);
  const float features = std::sqrt(std::max(edges, points) / std::numbers::sqrt2_v<float>);
  return std::pow(color_error(blurred_color(a, i), blurred_color(b, i)), 1.0F - std::min(features, 1.0F));
}

}  // namespace

FlipError flip_error(std::span<const float> image, std::span<const float> reference, Size size, int threads,
                     double pixels_per_degree) {
  HPR_CHECK(image.size() == size.area() * 3 && reference.size() == image.size() && pixels_per_degree > 0.0);
  FlipError result;
  if (size.area() == 0) return result;
  if (!all_finite(image) || !all_finite(reference)) {
    result.mean = std::numeric_limits<double>::quiet_NaN();
    return result;
  }
  const Filters filters = make_filters(pixels_per_degree);
  result.map = Image<float>(size);
  parallel_for(threads, band_count(size.height), [&](std::size_t band) {
    const int top = static_cast<int>(band) * kBandRows;
    const int rows = std::min(kBandRows, size.height - top);
    const FilteredRows a = filter_picture(image, size, top, rows, filters);
    const FilteredRows b = filter_picture(reference, size, top, rows, filters);
    const std::size_t first = static_cast<std::size_t>(top) * static_cast<std::size_t>(size.width);
    for (std::size_t i = 0; i < a.edges.pixels().size(); ++i) result.map.pixels()[first + i] = error_at(a, b, i);
  });
  const double sum = std::accumulate(result.map.pixels().begin(), result.map.pixels().end(), 0.0);
  result.mean = sum / static_cast<double>(size.area());
  return result;
}

}  // namespace hpr
