#include "walls/geometry/warped_picture.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/error.h"
#include "core/parallel.h"
#include "walls/drawing/level_table.h"

namespace hpr {
namespace {

constexpr double kParts = 65536.0;

std::uint32_t along(double place, int count) {
  const double from_middle = std::clamp(place - 0.5, 0.0, static_cast<double>(count - 1));
  return static_cast<std::uint32_t>(std::llround(from_middle * kParts));
}

const LevelTable& srgb_levels() {
  static const LevelTable levels([](float light) { return static_cast<double>(encode_srgb(light)); });
  return levels;
}

/// Bilinear reading of one picture.
class Reader {
 public:
  explicit Reader(const Image<Rgba8>& picture) : picture_(picture), to_level_(srgb_levels()) {}

  [[nodiscard]] Rgba8 at(const SourcePlace& place) const {
    const int x = static_cast<int>(place.x >> 16U);
    const int y = static_cast<int>(place.y >> 16U);
    const float right = static_cast<float>(place.x & 0xFFFFU) / 65536.0F;
    const float down = static_cast<float>(place.y & 0xFFFFU) / 65536.0F;
    const Rgba8 nearest = picture_.at(x, y);
    if (right == 0.0F && down == 0.0F) return nearest;
    const int beside = right > 0.0F ? x + 1 : x;
    const int below = down > 0.0F ? y + 1 : y;
    const std::array<Rgba8, 4> pixels{nearest, picture_.at(beside, y), picture_.at(x, below),
                                      picture_.at(beside, below)};
    const std::array<float, 4> weights{(1.0F - right) * (1.0F - down), right * (1.0F - down), (1.0F - right) * down,
                                       right * down};
    Rgb sum;
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      sum.r += weights[i] * srgb_to_linear(pixels[i].r);
      sum.g += weights[i] * srgb_to_linear(pixels[i].g);
      sum.b += weights[i] * srgb_to_linear(pixels[i].b);
    }
    return {to_level_(sum.r), to_level_(sum.g), to_level_(sum.b), nearest.a};
  }

 private:
  const Image<Rgba8>& picture_;
  const LevelTable& to_level_;
};

}  // namespace

SourcePlace source_place(double x, double y, Size size) {
  return {along(x, size.width), along(y, size.height)};
}

Image<Rgba8> warped(const Image<Rgba8>& picture, const Image<SourcePlace>& sources, int threads) {
  HPR_CHECK(picture.size().area() > 0);
  const Reader reader(picture);
  Image<Rgba8> result(sources.size(), {0, 0, 0, 255});
  parallel_for(threads, static_cast<std::size_t>(sources.height()), [&](std::size_t y) {
    const auto from = sources.row(static_cast<int>(y));
    const auto to = result.row(static_cast<int>(y));
    for (std::size_t x = 0; x < from.size(); ++x) {
      if (from[x] != kNoSource) to[x] = reader.at(from[x]);
    }
  });
  return result;
}

}  // namespace hpr
