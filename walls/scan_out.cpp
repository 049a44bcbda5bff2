#include "walls/scan_out.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/check.h"
#include "walls/assemble.h"
#include "walls/blend.h"

namespace hpr {
namespace {

using Levels = std::array<std::uint8_t, 256>;

std::uint8_t byte_of(double level) {
  return static_cast<std::uint8_t>(std::lround(255.0 * std::clamp(level, 0.0, 1.0)));
}

}  // namespace

double panel_level(const PanelColor& color, int channel, double light, double weight) {
  const double black = color.black[channel];
  const double shown = black + (1.0 - black) * std::clamp(color.gain[channel] * weight * light, 0.0, 1.0);
  const double level = encode_srgb(static_cast<float>(shown));
  return color.gamma[channel] == 1.0 ? level : std::pow(level, 1.0 / color.gamma[channel]);
}

Image<Rgba8> mirrored(const Image<Rgba8>& image, Mirror mirror) {
  Image<Rgba8> result = image;
  for (int y = 0; y < image.height(); ++y) {
    if (mirror == Mirror::Vertical) std::ranges::copy(image.row(image.height() - 1 - y), result.row(y).begin());
    if (mirror == Mirror::Horizontal) std::ranges::reverse(result.row(y));
  }
  return result;
}

ScanOut::ScanOut(const Wall& wall, std::size_t screen)
    : color_(wall.screens.at(screen).color),
      rotate_(wall.screens[screen].rotate),
      mirror_(wall.screens[screen].mirror),
      shades_(color_ != PanelColor{}) {
  const BlendWeights weights(wall, screen);
  if (weights.trivial()) return;
  shades_ = true;
  weights_ = Image<float>(wall.screens[screen].pixels);
  for (int y = 0; y < weights_.height(); ++y) {
    for (int x = 0; x < weights_.width(); ++x) weights_.at(x, y) = static_cast<float>(weights.at(x + 0.5, y + 0.5));
  }
}

Image<Rgba8> ScanOut::apply(const Image<Rgba8>& picture) const {
  const Image<Rgba8> turned = turn_clockwise(shades_ ? shade(picture) : picture, rotate_);
  return mirror_ == Mirror::None ? turned : mirrored(turned, mirror_);
}

Image<Rgba8> ScanOut::shade(const Image<Rgba8>& picture) const {
  HPR_CHECK(weights_.size().area() == 0 || weights_.size() == picture.size());
  std::array<float, 256> linear{};
  std::array<Levels, 3> whole{};  ///< where nothing is faded
  for (std::size_t i = 0; i < linear.size(); ++i) linear[i] = srgb_to_linear(static_cast<std::uint8_t>(i));
  for (std::size_t channel = 0; channel < whole.size(); ++channel) {
    for (std::size_t i = 0; i < linear.size(); ++i) {
      whole[channel][i] = byte_of(panel_level(color_, static_cast<int>(channel), linear[i], 1.0));
    }
  }
  Image<Rgba8> result = picture;
  for (int y = 0; y < picture.height(); ++y) {
    const auto row = result.row(y);
    for (int x = 0; x < picture.width(); ++x) {
      Rgba8& pixel = row[static_cast<std::size_t>(x)];
      const float weight = weights_.size().area() > 0 ? weights_.at(x, y) : 1.0F;
      if (weight >= 1.0F) {
        pixel = {whole[0][pixel.r], whole[1][pixel.g], whole[2][pixel.b], pixel.a};
        continue;
      }
      const auto level = [&](int channel, std::uint8_t value) {
        return byte_of(panel_level(color_, channel, linear[value], weight));
      };
      pixel = {level(0, pixel.r), level(1, pixel.g), level(2, pixel.b), pixel.a};
    }
  }
  return result;
}

}  // namespace hpr
