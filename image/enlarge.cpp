#include "image/enlarge.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"

namespace hpr {
namespace {

/// Two neighbours in a row or column, and how far a place is on its way from the first to the second.
struct Between {
  std::size_t first = 0;
  std::size_t second = 0;
  float way = 0.0F;
};

/// Where the centres of `to` pixels lie among those of `from`, on a side of equal length.
std::vector<Between> places(int from, int to) {
  std::vector<Between> all;
  all.reserve(static_cast<std::size_t>(to));
  for (int i = 0; i < to; ++i) {
    const double place = std::clamp((i + 0.5) * from / to - 0.5, 0.0, from - 1.0);
    const double below = std::floor(place);
    const auto first = static_cast<std::size_t>(below);
    all.push_back({first, std::min(first + 1, static_cast<std::size_t>(from) - 1), static_cast<float>(place - below)});
  }
  return all;
}

/// Exactly `a` where both are equal.
float mix(float a, float b, float way) {
  return a + (b - a) * way;
}

Rgb mix(const Rgb& a, const Rgb& b, float way) {
  return {mix(a.r, b.r, way), mix(a.g, b.g, way), mix(a.b, b.b, way)};
}

}  // namespace

Image<Rgb> enlarge(const Image<Rgb>& image, Size size, int threads) {
  HPR_CHECK(image.width() > 0 && image.height() > 0 && size.width > 0 && size.height > 0);
  constexpr int kRowsAtOnce = 16;
  const std::vector<Between> columns = places(image.width(), size.width);
  const std::vector<Between> rows = places(image.height(), size.height);
  Image<Rgb> large(size);
  const auto bands = static_cast<std::size_t>((size.height + kRowsAtOnce - 1) / kRowsAtOnce);
  parallel_for(threads, bands, [&](std::size_t band) {
    std::vector<Rgb> between(static_cast<std::size_t>(image.width()));
    const int first = static_cast<int>(band) * kRowsAtOnce;
    for (int y = first; y < std::min(first + kRowsAtOnce, size.height); ++y) {
      const Between& row = rows[static_cast<std::size_t>(y)];
      std::ranges::transform(image.row(static_cast<int>(row.first)), image.row(static_cast<int>(row.second)),
                             between.begin(), [&](const Rgb& a, const Rgb& b) { return mix(a, b, row.way); });
      std::ranges::transform(columns, large.row(y).begin(), [&](const Between& column) {
        return mix(between[column.first], between[column.second], column.way);
      });
    }
  });
  return large;
}

}  // namespace hpr
