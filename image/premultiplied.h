#pragma once

#include <cstdint>

/// Translucent pixels: colours already multiplied by their alpha, which is how much of what lies behind they hide. No
/// channel exceeds alpha, but for light a pixel adds without hiding anything. All zero bits is a transparent pixel.
namespace hpr {

/// Bytes in this order in memory, 255 is 1. What is stored is linear or not as its maker pleases: `over` blends it as
/// it stands.
struct Rgba8Premultiplied {
  std::uint8_t r = 0;
  std::uint8_t g = 0;
  std::uint8_t b = 0;
  std::uint8_t a = 0;

  bool operator==(const Rgba8Premultiplied&) const = default;
};

/// Linear radiance and alpha.
struct RgbaPremultiplied {
  float r = 0.0F;
  float g = 0.0F;
  float b = 0.0F;
  float a = 0.0F;

  bool operator==(const RgbaPremultiplied&) const = default;
};

}  // namespace hpr
