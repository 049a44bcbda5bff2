#include "image/pixel_filter.h"

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/text.h"

namespace hpr {
namespace {

constexpr std::array kAll{PixelFilter::Box, PixelFilter::Triangle, PixelFilter::Gaussian, PixelFilter::BSpline,
                          PixelFilter::Mitchell};

constexpr double kGaussianRadius = 1.5;

double radius_of(PixelFilter filter) {
  switch (filter) {
    case PixelFilter::Box:
      return 0.5;
    case PixelFilter::Triangle:
      return 1.0;
    case PixelFilter::Gaussian:
      return kGaussianRadius;
    case PixelFilter::BSpline:
    case PixelFilter::Mitchell:
      return 2.0;
  }
  return 0.5;
}

// Integrals of the filters from 0 to x >= 0, up to a factor. Those in two pieces meet at 1.

double b_spline_integral(double x) {
  // (4 - 6 x^2 + 3 x^3) / 6 below 1, (2 - x)^3 / 6 above
  if (x < 1.0) return (4.0 * x - 2.0 * x * x * x + 0.75 * x * x * x * x) / 6.0;
  const double rest = 2.0 - x;
  return 0.5 - rest * rest * rest * rest / 24.0;
}

/// Where Mitchell's filter turns negative. Beyond it, f = (7/18) (8/7 - x) (2 - x)^2.
constexpr double kMitchellRoot = 8.0 / 7.0;

/// The integral of f from x to 2, for x in [1, 2]. With y = 2 - x, f = (7/18) (y^3 - (6/7) y^2).
double mitchell_rest(double x) {
  const double y = 2.0 - x;
  return (7.0 / 18.0) * (0.25 * y * y * y * y - (2.0 / 7.0) * y * y * y);
}

double mitchell_absolute_integral(double x) {
  if (x < 1.0) return (1.75 * x * x * x * x - 4.0 * x * x * x + (16.0 / 3.0) * x) / 6.0;
  const double to_one = (1.75 - 4.0 + 16.0 / 3.0) / 6.0;
  if (x < kMitchellRoot) return to_one + mitchell_rest(1.0) - mitchell_rest(x);
  return to_one + mitchell_rest(1.0) - 2.0 * mitchell_rest(kMitchellRoot) + mitchell_rest(x);
}

double absolute_integral(PixelFilter filter, double x) {
  switch (filter) {
    case PixelFilter::Box:
      return x;
    case PixelFilter::Triangle:
      return x - 0.5 * x * x;
    case PixelFilter::Gaussian:
      return std::erf(std::sqrt(2.0) * x);
    case PixelFilter::BSpline:
      return b_spline_integral(x);
    case PixelFilter::Mitchell:
      return mitchell_absolute_integral(x);
  }
  return x;
}

/// The inverse of the cumulative distribution of |f|, by bisection: a frame asks for it twice, so that one method for
/// all filters is worth more than the fastest one for each.
double inverse(PixelFilter filter, double u) {
  const double radius = radius_of(filter);
  const double wanted = std::abs(2.0 * u - 1.0) * absolute_integral(filter, radius);
  double low = 0.0;
  double high = radius;
  for (int step = 0; step < 64; ++step) {
    const double middle = 0.5 * (low + high);
    (absolute_integral(filter, middle) < wanted ? low : high) = middle;
  }
  return u < 0.5 ? -low : low;
}

}  // namespace

std::string_view name_of(PixelFilter filter) {
  switch (filter) {
    case PixelFilter::Box:
      return "box";
    case PixelFilter::Triangle:
      return "triangle";
    case PixelFilter::Gaussian:
      return "gaussian";
    case PixelFilter::BSpline:
      return "b-spline";
    case PixelFilter::Mitchell:
      return "mitchell";
  }
  return "";
}

std::span<const PixelFilter> all_pixel_filters() {
  return kAll;
}

PixelFilter parse_pixel_filter(std::string_view name) {
  std::vector<std::string> choices;
  for (const PixelFilter filter : kAll) {
    if (name_of(filter) == name) return filter;
    choices.emplace_back(name_of(filter));
  }
  throw Error(ExitCode::Usage, "unknown pixel filter '" + printable(std::string(name)) + "'",
              unknown_name_hint(std::string(name), choices));
}

FilterSample sample_filter(PixelFilter filter, const glm::dvec2& u) {
  const glm::dvec2 offset(inverse(filter, u.x), inverse(filter, u.y));
  if (filter != PixelFilter::Mitchell) return {offset, 1.0};
  const bool negative = (std::abs(offset.x) > kMitchellRoot) != (std::abs(offset.y) > kMitchellRoot);
  return {offset, negative ? -1.0 : 1.0};
}

int least_samples(PixelFilter filter) {
  return filter == PixelFilter::Mitchell ? 16 : 1;
}

}  // namespace hpr
