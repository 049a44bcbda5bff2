#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "walls/geometry/geometry.h"

namespace hpr {
namespace {

/// A screen in the plane of the wall, in meters.
struct SeamBox {
  glm::dvec3 low{0.0};
  glm::dvec3 high{0.0};
  double pitch = 0.0;
};

/// Adds the seams between boxes of one line, which are sorted along `axis`.
class SeamCounter {
 public:
  explicit SeamCounter(WallSeams& seams) : seams_(seams) {}

  void start_line() { sum_ = 0.0; }

  void add(double gap_m, double pitch) {
    const double gap = gap_m / pitch;
    const double error = gap - std::round(gap);
    sum_ += error;
    seams_.narrowest_m = seams_.count == 0 ? gap_m : std::min(seams_.narrowest_m, gap_m);
    seams_.widest_m = seams_.count == 0 ? gap_m : std::max(seams_.widest_m, gap_m);
    seams_.largest_error_px = std::max(seams_.largest_error_px, std::abs(error));
    seams_.accumulated_error_px = std::max(seams_.accumulated_error_px, std::abs(sum_));
    ++seams_.count;
  }

 private:
  WallSeams& seams_;
  double sum_ = 0.0;
};

}  // namespace

WallSeams wall_seams(const Wall& wall) {
  const WallExtent extent = wall_extent(wall);
  WallSeams seams;
  if (!extent.flat) return seams;
  const glm::dmat3 inside = glm::transpose(extent.axes);
  std::vector<SeamBox> boxes;
  const bool has_left = std::ranges::any_of(wall.screens, [](const WallScreen& s) { return s.eye == Eye::Left; });
  for (const WallScreen& screen : wall.screens) {
    if (has_left && screen.eye == Eye::Right) continue;  // where the left eye's are
    const glm::dvec3 a = inside * (screen.lower_left - extent.center);
    const glm::dvec3 b = inside * (screen.lower_right + screen.upper_left - screen.lower_left - extent.center);
    boxes.push_back({glm::min(a, b), glm::max(a, b), pixel_pitch(screen)});
  }
  // Lines are found by whole steps, because a comparison with a tolerance would be no order to sort by.
  const double step = 1e-5 * (extent.width + extent.height);
  SeamCounter counter(seams);
  for (const int axis : {0, 1}) {
    const int across = 1 - axis;
    const auto line_of = [&](const SeamBox& box) {
      return std::pair(std::llround(box.low[across] / step), std::llround(box.high[across] / step));
    };
    std::ranges::sort(boxes, {}, [&](const SeamBox& box) { return std::pair(line_of(box), box.low[axis]); });
    for (std::size_t i = 1; i < boxes.size(); ++i) {
      const SeamBox& before = boxes[i - 1];
      const SeamBox& box = boxes[i];
      const bool neighbours = line_of(before) == line_of(box) && std::abs(before.pitch - box.pitch) < 1e-6 * box.pitch;
      if (neighbours) {
        counter.add(box.low[axis] - before.high[axis], box.pitch);
      } else {
        counter.start_line();
      }
    }
    counter.start_line();
  }
  return seams;
}

}  // namespace hpr
