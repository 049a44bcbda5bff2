#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "walls/config/wall.h"
#include "walls/geometry/planar.h"

namespace hpr {

/// The share of a wall's light each of some overlapping screens gives.
///
/// A screen's ramp rises from 0 at a faded edge to 1 within the blend's width: with the power p of blend.gamma it is
/// (2t)^p / 2 up to the middle of the width and 1 - (2 - 2t)^p / 2 beyond it, so that two ramps across one overlap sum
/// to 1 (Bourke, "Edge Blending Using Commodity Projectors", 2004). A screen's weight is its ramp by the sum of all
/// ramps that cover the point, so weights sum to 1 wherever screens overlap, however many; a screen that overlaps no
/// other keeps its ramp.
class BlendWeights {
 public:
  /// Of screen `screen` among those of its plane and eye that fade their edges. `wall` must outlive this.
  BlendWeights(const Wall& wall, std::size_t screen);

  /// All weights are 1.
  [[nodiscard]] bool trivial() const { return trivial_; }
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
  bool trivial_ = true;
};

}  // namespace hpr
