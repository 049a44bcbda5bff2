#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include "scene/scene.h"

namespace hpr::test {

/// Random inputs of tests that compare a device with the CPU, the awkward ones often among them.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  /// In [0, 1).
  double number() { return std::generate_canonical<double, 53>(engine_); }
  double between(double low, double high) { return low + (high - low) * number(); }
  std::uint32_t below(std::size_t count) { return static_cast<std::uint32_t>(engine_() % count); }
  bool chance(double probability) { return number() < probability; }
  glm::dvec2 two() { return {number(), number()}; }
  /// Of unit length.
  glm::dvec3 direction() {
    while (true) {
      const glm::dvec3 v = 2.0 * glm::dvec3(number(), number(), number()) - 1.0;
      const double length = glm::length(v);
      if (length > 0.1 && length <= 1.0) return v / length;
    }
  }
  /// Of a texture: inside, some periods off, on a texel's edge, huge, or no number.
  double coordinate() {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    constexpr std::array<double, 12> kOdd{0.0,   -0.0,      1.0,        -1.0,
                                          0.5,   2.0,       1e30,       -1e308,
                                          1e-30, kInfinity, -kInfinity, std::numeric_limits<double>::quiet_NaN()};
    switch (below(10)) {
      case 0:
        return kOdd.at(below(kOdd.size()));
      case 1:
        return between(-1e6, 1e6);
      case 2:
        return between(-1e11, 1e11);
      case 3:
        return static_cast<double>(below(33)) / 16.0 - 1.0;
      default:
        return between(-3.0, 4.0);
    }
  }
  glm::vec2 uv() { return {static_cast<float>(coordinate()), static_cast<float>(coordinate())}; }
  /// To one of `textures`.
  TextureRef reference(std::size_t textures) {
    TextureRef made;
    made.texture = static_cast<std::int32_t>(below(textures));
    made.uv_set = below(3);
    if (chance(0.5)) {
      for (float& entry : made.transform) entry = static_cast<float>(between(-2.0, 2.0));
    }
    return made;
  }

 private:
  std::mt19937_64 engine_;
};

/// Of several sizes with all wraps, one of them empty, one even, two of the same image.
inline std::vector<Texture> random_textures(Random& random) {
  std::vector<Texture> textures(2);
  for (const Size size : {Size{1, 1}, Size{2, 3}, Size{7, 5}, Size{16, 16}}) {
    for (const Wrap wrap_s : {Wrap::Repeat, Wrap::MirroredRepeat, Wrap::ClampToEdge}) {
      Image<Rgba8> image(size);
      for (int y = 0; y < size.height; ++y) {
        for (int x = 0; x < size.width; ++x) {
          const auto level = [&] { return static_cast<std::uint8_t>(random.below(256)); };
          image.at(x, y) = {level(), level(), level(), level()};
        }
      }
      Texture& texture = textures.emplace_back();
      texture.image = std::move(image);
      texture.wrap_s = wrap_s;
      texture.wrap_t = static_cast<Wrap>(random.below(3));
      texture.nearest = random.chance(0.3);
    }
  }
  Image<Rgba8> even({3, 3});
  for (int i = 0; i < 9; ++i) even.at(i % 3, i / 3) = {200, 100, 50, 25};
  textures[1].image = std::move(even);
  textures.push_back(textures.back());
  textures.back().nearest = !textures.back().nearest;
  return textures;
}

}  // namespace hpr::test
