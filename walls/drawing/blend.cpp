#include "walls/drawing/blend.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "walls/geometry/planar.h"

namespace hpr {
namespace {

/// Widths in metres: left, right, bottom, top.
using Fades = std::array<double, 4>;

/// More than measuring noise: screens that only touch do not overlap.
bool overlaps(const PlanarBox& box, const WallScreen& screen) {
  return shared_metres(box, screen) > 1e-6 * (screen_width(screen) + screen_height(screen));
}

/// Widens `fades` to how far `other` reaches over each side of `screen`.
void reach_over(const WallScreen& screen, const WallScreen& other, Fades& fades) {
  const auto box = seen_from(other, screen);
  if (!box || !overlaps(*box, screen)) return;
  const std::array<double, 2> size{screen_width(screen), screen_height(screen)};
  const double least = 1e-6 * (size[0] + size[1]);
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const bool over_low = box->low[axis] < least;
    const bool over_high = box->high[axis] > size[axis] - least;
    if (over_low == over_high) continue;  // over both: it lies beside, along the other axis
    double& side = fades[2 * axis + (over_low ? 0 : 1)];
    side = std::max(side, over_low ? box->high[axis] : size[axis] - box->low[axis]);
  }
}

Fades fades_of(const Wall& wall, const WallScreen& screen) {
  const EdgeBlend& blend = screen.blend;
  Fades fades{blend.left, blend.right, blend.bottom, blend.top};
  if (!blend.automatic) return fades;
  for (const auto* screens : {&wall.screens, &wall.elsewhere}) {
    for (const WallScreen& other : *screens) {
      if (&other != &screen && other.blend.any()) reach_over(screen, other, fades);
    }
  }
  return fades;
}

/// From 0 at the edge to 1 at `width` from it.
double rise(double distance, double width, double gamma) {
  if (width <= 0.0) return 1.0;
  const double t = std::clamp(distance / width, 0.0, 1.0);
  return t < 0.5 ? 0.5 * std::pow(2.0 * t, gamma) : 1.0 - 0.5 * std::pow(2.0 - 2.0 * t, gamma);
}

}  // namespace

BlendWeights::BlendWeights(const Wall& wall, std::size_t screen) {
  HPR_CHECK(screen < wall.screens.size());
  const WallScreen& mine = wall.screens[screen];
  width_ = screen_width(mine);
  height_ = screen_height(mine);
  pixels_ = mine.pixels;
  if (!mine.blend.any()) return;
  add(wall, mine, {{0.0, 0.0}, {width_, height_}, false, {1, 1}});
  for (const auto* screens : {&wall.screens, &wall.elsewhere}) {
    for (const WallScreen& other : *screens) {
      if (&other == &mine || !other.blend.any()) continue;
      const auto box = seen_from(other, mine);
      if (box && overlaps(*box, mine)) add(wall, other, *box);
    }
  }
}

void BlendWeights::add(const Wall& wall, const WallScreen& screen, const PlanarBox& box) {
  const Fades fades = fades_of(wall, screen);
  Area area{box.low, box.high, {}, {}, screen.blend.gamma};
  for (std::size_t axis = 0; axis < 2; ++axis) {  // of that screen
    const std::size_t here = box.swapped ? 1 - axis : axis;
    const bool with = box.along[axis] > 0;
    area.fade_low[here] = fades[2 * axis + (with ? 0 : 1)];
    area.fade_high[here] = fades[2 * axis + (with ? 1 : 0)];
  }
  trivial_ = trivial_ && std::ranges::max(fades) <= 0.0;
  areas_.push_back(area);
}

double BlendWeights::ramp(const Area& area, double u, double v) {
  const std::array<double, 2> at{u, v};
  double product = 1.0;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    product *= rise(at[axis] - area.low[axis], area.fade_low[axis], area.gamma) *
               rise(area.high[axis] - at[axis], area.fade_high[axis], area.gamma);
  }
  return product;
}

double BlendWeights::at(double x, double y) const {
  if (trivial_) return 1.0;
  const double u = x / pixels_.width * width_;
  const double v = (1.0 - y / pixels_.height) * height_;
  const double own = ramp(areas_.front(), u, v);
  if (areas_.size() == 1) return own;
  double sum = 0.0;
  int covering = 0;
  for (const Area& area : areas_) {
    const bool covers = u >= area.low[0] && u <= area.high[0] && v >= area.low[1] && v <= area.high[1];
    if (!covers) continue;
    sum += ramp(area, u, v);
    ++covering;
  }
  return sum > 0.0 ? own / sum : 1.0 / std::max(covering, 1);
}

}  // namespace hpr
