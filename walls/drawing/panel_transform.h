#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "walls/config/wall.h"
#include "walls/geometry/neighbors.h"
#include "walls/geometry/warping.h"

namespace hpr {

/// The fraction of a wall's light that each of some overlapping screens gives.
///
/// A screen's ramp rises from 0 at a faded edge to 1 within the blend's width: with the power p of blend.gamma it is
/// (2t)^p / 2 up to the middle of the width and 1 - (2 - 2t)^p / 2 beyond it, so that two ramps across one overlap sum
/// to 1 (Bourke, "Edge Blending Using Commodity Projectors", 2004). A screen's weight is its ramp by the sum of all
/// ramps that cover the point, so weights sum to 1 wherever screens overlap, however many; a screen that overlaps no
/// other keeps its ramp.
class BlendWeights {
 public:
  /// Makes the weights of screen `screen` among those of its plane and eye that fade their edges. `wall` must outlive
  /// this.
  BlendWeights(const Wall& wall, std::size_t screen);

  /// Whether all weights are 1.
  [[nodiscard]] bool is_identity() const { return is_identity_; }
  /// At (x, y) of the screen, in pixels of its upright picture from the upper left corner; in [0, 1], of linear light.
  [[nodiscard]] double at(double x, double y) const;

 private:
  /// A screen in the plane of the one asked for: metres along its right and up from its lower left corner.
  struct Area {
    std::array<double, 2> low{};
    std::array<double, 2> high{};
    std::array<double, 2> fade_low{};   ///< widths at the left and the lower edge
    std::array<double, 2> fade_high{};  ///< at the right and the upper edge
    double gamma = 1.0;
  };

  /// A screen whose rectangle is `box` in the plane of the one asked for.
  void add(const Wall& wall, const WallScreen& screen, const PlanarBox& box);
  [[nodiscard]] static double ramp(const Area& area, double u, double v);

  double width_ = 0.0;
  double height_ = 0.0;
  Size pixels_;
  std::vector<Area> areas_;  ///< the first is the screen itself
  bool is_identity_ = true;
};

/// What a screen's panel is sent: the upright picture through the screen's warp mesh, with faded edges and the panel's
/// colours, turned clockwise and then mirrored as the panel is mounted. It does not change from frame to frame, so it
/// is made once per screen.
class PanelTransform {
 public:
  /// `wall` must outlive this.
  PanelTransform(const Wall& wall, std::size_t screen);

  /// Whether the panel is sent the picture as it is.
  [[nodiscard]] bool is_identity() const {
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

  Image<SourcePosition> sources_;  ///< empty: each pixel shows its own place
  Image<Rgb> weights_;             ///< of linear light; empty: all 1
  Image<Rgb> floors_;              ///< linear light shown at least; empty: all 0
  Image<std::uint8_t> dark_;       ///< 1 where no light falls; empty: nowhere
  PanelColor color_;
  int rotate_ = 0;
  Mirror mirror_ = Mirror::None;
  std::vector<Rect> parts_;  ///< of the eyes' pictures
  bool shades_ = false;
  std::vector<LevelTable> to_level_;  ///< per channel, where pixels are shaded
};

/// `image` as in a mirror: left and right swap for Horizontal, top and bottom for Vertical.
[[nodiscard]] Image<Rgba8> flip(const Image<Rgba8>& image, Mirror mirror);

/// The sRGB level in [0, 1] a panel is sent for `light` in linear [0, 1], faded by `weight`, on top of a `floor` that
/// only this place has; `channel` 0 to 2.
[[nodiscard]] double panel_level(const PanelColor& color, int channel, double light, double weight, double floor = 0.0);

}  // namespace hpr
