#include "rt/lights/environment_map.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "core/error.h"
#include "rt/sampling/sampling.h"

namespace hpr {
namespace {

constexpr double kPi = std::numbers::pi;

double brightness(const glm::dvec3& radiance) {
  return (radiance.r + radiance.g + radiance.b) / 3.0;
}

}  // namespace

glm::dvec3 EnvironmentMap::texel(int x, int y) const {
  const Image<Rgb>& image = environment_->image;
  const Rgb& stored = image.at((x + image.width()) % image.width(), std::clamp(y, 0, image.height() - 1));
  return environment_->scale * glm::dvec3(stored.r, stored.g, stored.b);
}

/// Over the texel's square: what bilinear interpolation brings in from its neighbours included.
glm::dvec3 EnvironmentMap::texel_mean(int x, int y) const {
  const auto across = [&](int row) {
    return 0.125 * texel(x - 1, row) + 0.75 * texel(x, row) + 0.125 * texel(x + 1, row);
  };
  return 0.125 * across(y - 1) + 0.75 * across(y) + 0.125 * across(y + 1);
}

EnvironmentMap::EnvironmentMap(const Environment& environment) : environment_(&environment) {
  const Size size = environment.image.size();
  HPR_CHECK(size.area() > 0);
  texel_sums_.reserve(size.area());
  double sum = 0.0;
  double squares = 0.0;
  for (int y = 0; y <= size.height; ++y) row_cosines_.push_back(std::cos(kPi * y / size.height));
  row_cosines_.back() = -1.0;
  for (int y = 0; y < size.height; ++y) {
    glm::dvec3 row(0.0);
    double row_sum = 0.0;
    double row_squares = 0.0;
    for (int x = 0; x < size.width; ++x) {
      const glm::dvec3 radiance = texel_mean(x, y);
      row += radiance;
      texel_sums_.push_back(row_sum += brightness(radiance));
      row_squares += brightness(radiance) * brightness(radiance);
    }
    const auto at = static_cast<std::size_t>(y);
    const double fraction = 0.5 * (row_cosines_[at] - row_cosines_[at + 1]) / size.width;  // of the sphere, per texel
    mean_ += fraction * row;
    row_sums_.push_back(sum += fraction * row_sum);
    squares += fraction * row_squares;
  }
  // Relative variances of one sample of a matte surface under open sky: by the cosine, that of the brightness; by
  // brightness, for a constant one, 5/3. Each has its share by how little the other is good for.
  constexpr double kByBrightness = 5.0 / 3.0;
  const double by_cosine = sum > 0.0 ? std::max(0.0, squares / (sum * sum) - 1.0) : 0.0;
  cosine_fraction_ = is_constant() ? 1.0 : kByBrightness / (kByBrightness + by_cosine);
}

EnvironmentMap::DirectionalRadiance EnvironmentMap::evaluate(const glm::dvec3& direction) const {
  const Size size = environment_->image.size();
  if (is_constant()) return {mean_, row_sums_.back() > 0.0 ? 0.25 / kPi : 0.0};
  const double turn = 0.5 + (std::atan2(direction.x, -direction.z) + environment_->rotation_radians) / (2.0 * kPi);
  const double s = (turn - std::floor(turn)) * size.width;
  const double t = std::acos(std::clamp(direction.y, -1.0, 1.0)) / kPi * size.height;
  const int column = std::min(static_cast<int>(s), size.width - 1);
  const int row = std::min(static_cast<int>(t), size.height - 1);

  DirectionalRadiance seen;
  const int x0 = static_cast<int>(std::floor(s - 0.5));
  const int y0 = static_cast<int>(std::floor(t - 0.5));
  const double fx = s - 0.5 - x0;
  const double fy = t - 0.5 - y0;
  const auto between = [&](int y) { return (1.0 - fx) * texel(x0, y) + fx * texel(x0 + 1, y); };
  seen.radiance = (1.0 - fy) * between(y0) + fy * between(y0 + 1);

  const auto width = static_cast<std::size_t>(size.width);
  const std::size_t index = static_cast<std::size_t>(row) * width + static_cast<std::size_t>(column);
  const double value = texel_sums_[index] - (column > 0 ? texel_sums_[index - 1] : 0.0);
  // The texel's share of all brightness, over its solid angle, which is in the share: row_sums_ are parts of the
  // sphere, 4 pi.
  if (row_sums_.back() > 0.0) seen.pdf = value / (4.0 * kPi * row_sums_.back());
  return seen;
}

glm::dvec3 EnvironmentMap::sample(const glm::dvec2& u) const {
  const auto width = static_cast<std::size_t>(environment_->image.width());
  const DiscreteSample row = sample_discrete(row_sums_, u.y);
  const DiscreteSample column = sample_discrete(std::span(texel_sums_).subspan(row.index * width, width), u.x);
  const double y = row_cosines_[row.index] + row.rest * (row_cosines_[row.index + 1] - row_cosines_[row.index]);
  const double turn = (static_cast<double>(column.index) + column.rest) / static_cast<double>(width) - 0.5;
  const double angle = 2.0 * kPi * turn - environment_->rotation_radians;
  const double across = std::sqrt(std::max(0.0, (1.0 - y) * (1.0 + y)));
  return {across * std::sin(angle), y, -across * std::cos(angle)};
}

}  // namespace hpr
