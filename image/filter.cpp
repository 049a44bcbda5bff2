#include "image/filter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"
#include "core/text.h"

namespace hpr {
namespace {

/// out[x] = sum over i of weights[i] in[x + i * step]
template <typename Real>
void weighted_sums(std::span<const Real> in, std::size_t step, std::span<const Real> weights, std::span<Real> out) {
  HPR_CHECK(in.size() >= out.size() + (weights.size() - 1) * step);
  // The sums of a block stay in registers while the weights pass by.
  constexpr std::size_t kBlock = 16;
  std::size_t x = 0;
  for (; x + kBlock <= out.size(); x += kBlock) {
    std::array<Real, kBlock> sums{};
    for (std::size_t i = 0; i < weights.size(); ++i) {
      const Real* const from = &in[x + i * step];
      for (std::size_t lane = 0; lane < kBlock; ++lane) sums[lane] += weights[i] * from[lane];
    }
    std::ranges::copy(sums, out.begin() + static_cast<std::ptrdiff_t>(x));
  }
  for (; x < out.size(); ++x) {
    Real sum = 0;
    for (std::size_t i = 0; i < weights.size(); ++i) sum += weights[i] * in[x + i * step];
    out[x] = sum;
  }
}

/// Two neighbours in a row or column, and the fraction of the distance from the first to the second at which a position
/// lies.
struct Between {
  std::size_t first = 0;
  std::size_t second = 0;
  float fraction = 0.0F;
};

/// Some of the pixels of a side.
struct SidePart {
  int whole = 0;
  int first = 0;
  int end = 0;
};

/// The positions of the centres of the pixels `to` among those `from`, on a side of equal length.
std::vector<Between> sample_positions(const SidePart& from, const SidePart& to) {
  std::vector<Between> all;
  all.reserve(static_cast<std::size_t>(to.end - to.first));
  for (int i = to.first; i < to.end; ++i) {
    const double position = std::clamp((i + 0.5) * from.whole / to.whole - 0.5, 0.0, from.whole - 1.0);
    const double below = std::floor(position);
    const int first = static_cast<int>(below);
    const int second = std::min(first + 1, from.whole - 1);
    HPR_CHECK(first >= from.first && second < from.end);
    all.push_back({static_cast<std::size_t>(first - from.first), static_cast<std::size_t>(second - from.first),
                   static_cast<float>(position - below)});
  }
  return all;
}

/// Exactly `a` where both are equal.
float mix(float a, float b, float fraction) {
  return a + (b - a) * fraction;
}

Rgb mix(const Rgb& a, const Rgb& b, float fraction) {
  return {mix(a.r, b.r, fraction), mix(a.g, b.g, fraction), mix(a.b, b.b, fraction)};
}

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
    const double midpoint = 0.5 * (low + high);
    (absolute_integral(filter, midpoint) < wanted ? low : high) = midpoint;
  }
  return u < 0.5 ? -low : low;
}

}  // namespace

template <typename Real>
Image<Real> filter_rows(const Image<Real>& in, std::span<const Real> weights) {
  const int width = in.width() - static_cast<int>(weights.size()) + 1;
  HPR_CHECK(!weights.empty() && width > 0);
  Image<Real> out({width, in.height()});
  for (int y = 0; y < in.height(); ++y) weighted_sums<Real>(in.row(y), 1, weights, out.row(y));
  return out;
}

template <typename Real>
Image<Real> filter_columns(const Image<Real>& in, std::span<const Real> weights) {
  const int height = in.height() - static_cast<int>(weights.size()) + 1;
  HPR_CHECK(!weights.empty() && height > 0);
  Image<Real> out({in.width(), height});
  const auto width = static_cast<std::size_t>(in.width());
  for (int y = 0; y < height; ++y) {
    const std::span<const Real> below = in.pixels().subspan(static_cast<std::size_t>(y) * width);
    weighted_sums<Real>(below, width, weights, out.row(y));
  }
  return out;
}

template Image<float> filter_rows(const Image<float>&, std::span<const float>);
template Image<float> filter_columns(const Image<float>&, std::span<const float>);
template Image<double> filter_rows(const Image<double>&, std::span<const double>);
template Image<double> filter_columns(const Image<double>&, std::span<const double>);

Image<Rgb> enlarge(const Image<Rgb>& image, Size size, int threads) {
  const auto all_of = [](Size whole) { return PicturePart{whole, {0, 0, whole.width, whole.height}}; };
  return enlarge(image, all_of(image.size()), all_of(size), threads);
}

Image<Rgb> enlarge(const Image<Rgb>& image, const PicturePart& made, const PicturePart& shown, int threads) {
  const Size size{shown.pixels.width(), shown.pixels.height()};
  HPR_CHECK(image.width() > 0 && image.height() > 0 && size.width > 0 && size.height > 0);
  HPR_CHECK(image.width() == made.pixels.width() && image.height() == made.pixels.height());
  constexpr int kRowsAtOnce = 16;
  const auto columns = sample_positions({made.whole.width, made.pixels.x0, made.pixels.x1},
                                        {shown.whole.width, shown.pixels.x0, shown.pixels.x1});
  const auto rows = sample_positions({made.whole.height, made.pixels.y0, made.pixels.y1},
                                     {shown.whole.height, shown.pixels.y0, shown.pixels.y1});
  Image<Rgb> large(size);
  const auto bands = static_cast<std::size_t>((size.height + kRowsAtOnce - 1) / kRowsAtOnce);
  parallel_for(threads, bands, [&](std::size_t band) {
    std::vector<Rgb> between(static_cast<std::size_t>(image.width()));
    const int first = static_cast<int>(band) * kRowsAtOnce;
    for (int y = first; y < std::min(first + kRowsAtOnce, size.height); ++y) {
      const Between& row = rows[static_cast<std::size_t>(y)];
      std::ranges::transform(image.row(static_cast<int>(row.first)), image.row(static_cast<int>(row.second)),
                             between.begin(), [&](const Rgb& a, const Rgb& b) { return mix(a, b, row.fraction); });
      std::ranges::transform(columns, large.row(y).begin(), [&](const Between& column) {
        return mix(between[column.first], between[column.second], column.fraction);
      });
    }
  });
  return large;
}

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

int min_samples(PixelFilter filter) {
  return filter == PixelFilter::Mitchell ? 16 : 1;
}

}  // namespace hpr
