#include "walls/displays/y4m.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <string_view>

namespace hpr {
namespace {

constexpr int kBits = 20;
constexpr double kRed = 0.2126;
constexpr double kGreen = 0.7152;
constexpr double kBlue = 0.0722;

/// Weights of red, green and blue in units of 2^-kBits, and what is added before the bits are dropped. Their error
/// over three channels, 255 * 1.5 / 2^20, is 4e-4 levels.
struct Row {
  std::int32_t red;
  std::int32_t green;
  std::int32_t blue;
  std::int32_t offset;

  [[nodiscard]] std::byte of(Rgba8 color) const {
    return static_cast<std::byte>((red * color.r + green * color.g + blue * color.b + offset) >> kBits);
  }
};

constexpr std::int32_t fixed(double value) {
  const double scaled = value * (1 << kBits);
  return static_cast<std::int32_t>(scaled < 0.0 ? scaled - 0.5 : scaled + 0.5);
}

constexpr Row row(double red, double green, double blue, double range, int zero) {
  const double scale = range / 255.0;
  return {fixed(red * scale), fixed(green * scale), fixed(blue * scale), (zero << kBits) + (1 << (kBits - 1))};
}

constexpr Row kLuma = row(kRed, kGreen, kBlue, 219.0, 16);
// (B - Y) / (2 (1 - kBlue)) and (R - Y) / (2 (1 - kRed)): the largest difference becomes one half.
constexpr double kBlueScale = 2.0 * (1.0 - kBlue);
constexpr double kRedScale = 2.0 * (1.0 - kRed);
constexpr Row kChromaBlue = row(-kRed / kBlueScale, -kGreen / kBlueScale, 0.5, 224.0, 128);
constexpr Row kChromaRed = row(0.5, -kGreen / kRedScale, -kBlue / kRedScale, 224.0, 128);

}  // namespace

std::string y4m_header(Size size, int frames_per_second) {
  return fmt::format("YUV4MPEG2 W{} H{} F{}:1 Ip A1:1 C444 XCOLORRANGE=LIMITED\n", size.width, size.height,
                     frames_per_second);
}

void append_y4m_frame(const Image<Rgba8>& image, std::vector<std::byte>& bytes) {
  constexpr std::string_view kStart = "FRAME\n";
  const std::size_t pixels = image.size().area();
  const std::size_t at = bytes.size() + kStart.size();
  bytes.resize(at + 3 * pixels);
  for (std::size_t i = 0; i < kStart.size(); ++i) bytes[at - kStart.size() + i] = static_cast<std::byte>(kStart[i]);
  std::byte* const luma = bytes.data() + at;
  std::byte* const blue = luma + pixels;
  std::byte* const red = blue + pixels;
  const auto colors = image.pixels();
  for (std::size_t i = 0; i < pixels; ++i) {
    luma[i] = kLuma.of(colors[i]);
    blue[i] = kChromaBlue.of(colors[i]);
    red[i] = kChromaRed.of(colors[i]);
  }
}

}  // namespace hpr
