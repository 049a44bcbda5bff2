#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "walls/config/wall.h"
#include "walls/drawing/level_table.h"
#include "walls/geometry/warped_picture.h"

namespace hpr {

/// What a screen's panel is sent: the upright picture through the screen's warp mesh, with faded edges and the panel's
/// colours, turned clockwise and then mirrored as the panel is mounted. The same for every frame, so made once per
/// screen.
class ScanOut {
 public:
  /// `wall` must outlive this.
  ScanOut(const Wall& wall, std::size_t screen);

  /// The panel is sent the picture as it is.
  [[nodiscard]] bool trivial() const {
    return !shades_ && sources_.size().area() == 0 && rotate_ == 0 && mirror_ == Mirror::None;
  }

  /// `picture` has the screen's pixels; the result has panel_pixels(). Alpha stays.
  [[nodiscard]] Image<Rgba8> apply(const Image<Rgba8>& picture) const;

 private:
  /// A picture as its panel is mounted.
  [[nodiscard]] Image<Rgba8> mounted(Image<Rgba8> picture) const;
  void read_blend(const Wall& wall, std::size_t screen);
  void read_warp(const Wall& wall, std::size_t screen);
  void shade(Image<Rgba8>& picture, int channel) const;

  Image<SourcePlace> sources_;  ///< empty: each pixel shows its own place
  Image<Rgb> weights_;          ///< of linear light; empty: all 1
  Image<Rgb> floors_;           ///< linear light shown at least; empty: all 0
  Image<std::uint8_t> dark_;    ///< 1 where no light falls; empty: nowhere
  PanelColor color_;
  int rotate_ = 0;
  Mirror mirror_ = Mirror::None;
  std::vector<Rect> parts_;  ///< of the eyes' pictures
  bool shades_ = false;
  std::vector<LevelTable> to_level_;  ///< per channel, where pixels are shaded
};

/// `image` as in a mirror: left and right swap for Horizontal, top and bottom for Vertical.
[[nodiscard]] Image<Rgba8> mirrored(const Image<Rgba8>& image, Mirror mirror);

/// The sRGB level in [0, 1] a panel is sent for `light` in linear [0, 1], faded by `weight`, on top of a `floor` that
/// only this place has; `channel` 0 to 2.
[[nodiscard]] double panel_level(const PanelColor& color, int channel, double light, double weight, double floor = 0.0);

}  // namespace hpr
