#pragma once

#include <cstddef>

#include "image/color.h"
#include "image/image.h"
#include "walls/wall.h"

namespace hpr {

/// What a screen's panel is sent: the upright picture with faded edges and the panel's colours, turned clockwise and
/// then mirrored as the panel is mounted. The same for every frame, so made once per screen.
class ScanOut {
 public:
  /// `wall` must outlive this.
  ScanOut(const Wall& wall, std::size_t screen);

  /// The panel is sent the picture as it is.
  [[nodiscard]] bool trivial() const { return !shades_ && rotate_ == 0 && mirror_ == Mirror::None; }

  /// `picture` has the screen's pixels; the result has panel_pixels(). Alpha stays.
  [[nodiscard]] Image<Rgba8> apply(const Image<Rgba8>& picture) const;

 private:
  [[nodiscard]] Image<Rgba8> shade(const Image<Rgba8>& picture) const;

  Image<float> weights_;  ///< of linear light; empty: all 1
  PanelColor color_;
  int rotate_ = 0;
  Mirror mirror_ = Mirror::None;
  bool shades_ = false;
};

/// `image` as in a mirror: left and right swap for Horizontal, top and bottom for Vertical.
[[nodiscard]] Image<Rgba8> mirrored(const Image<Rgba8>& image, Mirror mirror);

/// The sRGB level in [0, 1] a panel is sent for `light` in linear [0, 1], faded by `weight`; `channel` 0 to 2.
[[nodiscard]] double panel_level(const PanelColor& color, int channel, double light, double weight);

}  // namespace hpr
