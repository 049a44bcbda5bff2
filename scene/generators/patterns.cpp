#include "scene/generators/patterns.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/error.h"
#include "scene/generators/portable_math.h"

namespace hpr::patterns {
namespace {

constexpr Rgba8 kBlack{0, 0, 0, 255};
constexpr Rgba8 kWhite{255, 255, 255, 255};

template <typename Texel>
Image<Rgba8> painted(Size size, Texel texel) {
  HPR_CHECK(size.width > 0 && size.height > 0);
  Image<Rgba8> image(size);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) image.at(x, y) = texel(x, y);
  }
  return image;
}

std::uint8_t level(int part, int whole) {
  return static_cast<std::uint8_t>(255 * part / std::max(whole, 1));
}

}  // namespace

Image<Rgba8> zone_plate(Size size) {
  return painted(size, [&](int x, int y) {
    // Four times the squared radius, an integer: whole turns can be taken off exactly.
    const std::int64_t u = 2 * x + 1 - size.width;
    const std::int64_t v = 2 * y + 1 - size.height;
    const std::int64_t period = std::int64_t{8} * size.width;
    const double turns = static_cast<double>((u * u + v * v) % period) / static_cast<double>(period);
    const auto intensity = static_cast<float>(0.5 + 0.5 * portable::cos_turns(turns));
    return to_srgb({intensity, intensity, intensity});
  });
}

Image<Rgba8> texel_grid(Size size, int step) {
  HPR_CHECK(step > 0);
  return painted(size, [&](int x, int y) { return x % step == 0 || y % step == 0 ? kBlack : kWhite; });
}

Image<Rgba8> siemens_star(Size size, int lines) {
  HPR_CHECK(lines > 0 && lines % 2 == 0);
  std::vector<std::pair<double, double>> directions;
  for (int i = 0; i < lines; ++i) {
    const double turns = (i + 0.25) / (2.0 * lines);  // a little turned: no line through texel centres
    directions.emplace_back(portable::cos_turns(turns), portable::sin_turns(turns));
  }
  return painted(size, [&](int x, int y) {
    const double u = x + 0.5 - 0.5 * size.width;
    const double v = y + 0.5 - 0.5 * size.height;
    // Crossing a line changes the side of just this one, so the parity alternates from sector to sector.
    const auto left_of = std::ranges::count_if(directions, [&](auto d) { return d.first * v - d.second * u > 0.0; });
    return left_of % 2 == 0 ? kWhite : kBlack;
  });
}

Image<Rgba8> grey_wedge(Size size, int steps) {
  return painted(size, [&](int x, int) {
    const std::uint8_t grey = level(x * steps / size.width, steps - 1);
    return Rgba8{grey, grey, grey, 255};
  });
}

Image<Rgba8> tile_ruler(Size size) {
  constexpr int kCell = 32;
  constexpr int kDigit = 6;  // texels from digit to digit, four of them lit
  return painted(size, [&](int x, int y) {
    const int column = x % kCell;
    const int line = y % kCell;
    if (column == 0 || line == 0) return kBlack;
    const int digit = (column - 1) / kDigit;
    const bool upper = line >= 8 && line < 12;
    const bool lower = line >= 20 && line < 24;
    if ((upper || lower) && digit < 5 && (column - 1) % kDigit < 4) {
      const int number = upper ? x / kCell : y / kCell;
      return ((number >> (4 - digit)) & 1) != 0 ? kWhite : kBlack;
    }
    return Rgba8{level(x, size.width - 1), level(y, size.height - 1), 160, 255};
  });
}

Image<Rgba8> checker(Rgb odd, Rgb even) {
  return painted({2, 2}, [&](int x, int y) { return x == y ? to_srgb(odd) : to_srgb(even); });
}

}  // namespace hpr::patterns
