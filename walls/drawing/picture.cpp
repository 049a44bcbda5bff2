#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>

#include "walls/geometry/geometry.h"

namespace hpr {
namespace {

/// A screen's place in the plan, in metres, y down.
struct Box {
  double x = 0.0;
  double y = 0.0;
  double width = 0.0;
  double height = 0.0;
};

bool same_plane(const WallScreen& a, const WallScreen& b) {
  constexpr double kParallel = 1.0 - 1e-9;
  const glm::dvec3 normal = screen_axes(a)[2];
  const double size = screen_width(a) + screen_width(b);
  return glm::dot(normal, screen_axes(b)[2]) > kParallel &&
         std::abs(glm::dot(normal, b.lower_left - a.lower_left)) < 1e-6 * size;
}

/// From straight ahead, clockwise seen from above.
double heading_of(const glm::dvec3& towards, const glm::dvec3& ahead) {
  return std::atan2(towards.z * ahead.x - towards.x * ahead.z, towards.x * ahead.x + towards.z * ahead.z);
}

/// Screens of one plane, laid out as seen from the viewer's side.
struct Plane {
  std::vector<std::size_t> screens;
  WallExtent extent;
};

void lay_out(const Wall& wall, const Plane& plane, double x, double y, std::vector<Box>& boxes) {
  const glm::dmat3 inside = glm::transpose(plane.extent.axes);
  for (const std::size_t i : plane.screens) {
    const WallScreen& screen = wall.screens[i];
    const glm::dvec3 a = inside * (screen.lower_left - plane.extent.center);
    const glm::dvec3 b = inside * (screen.lower_right + screen.upper_left - screen.lower_left - plane.extent.center);
    const glm::dvec3 low = glm::min(a, b);
    const glm::dvec3 high = glm::max(a, b);
    boxes[i] = {x + low.x + 0.5 * plane.extent.width, y - high.y + 0.5 * plane.extent.height, high.x - low.x,
                high.y - low.y};
  }
}

struct Layout {
  std::vector<Box> boxes;   ///< of the screens
  std::vector<Box> planes;  ///< of wall_planes()
  double width = 0.0;
  double height = 0.0;
};

/// Planes that stand side by side in the picture: ceilings face down, floors up, the rest stands.
struct Row {
  std::vector<const Plane*> planes;
  double width = 0.0;
  double height = 0.0;
};

/// Ceilings, what stands, floors: from the top, each with `margin` between its planes.
std::array<Row, 3> rows_of(const std::vector<Plane>& planes, double margin) {
  constexpr double kLying = 0.7;
  std::array<Row, 3> rows;
  for (const Plane& plane : planes) {
    const double facing = plane.extent.axes[2].y;
    Row& row = rows[facing < -kLying ? 0 : facing > kLying ? 2 : 1];
    row.width += plane.extent.width + (row.planes.empty() ? 0.0 : margin);
    row.height = std::max(row.height, plane.extent.height);
    row.planes.push_back(&plane);
  }
  return rows;
}

Layout layout_of(const Wall& wall) {
  std::vector<Plane> planes;
  for (auto& screens : wall_planes(wall)) {
    const WallExtent extent = wall_extent(screens_of(wall, screens));
    planes.push_back({std::move(screens), extent});
  }
  const WallExtent whole = wall_extent(wall);
  const double margin = planes.size() > 1 ? 0.05 * (whole.width + whole.height) : 0.0;
  const std::array<Row, 3> rows = rows_of(planes, margin);

  Layout layout{std::vector<Box>(wall.screens.size()), std::vector<Box>(planes.size()), 0.0, 0.0};
  layout.width = std::ranges::max_element(rows, {}, &Row::width)->width;
  for (const Row& row : rows) {
    if (row.planes.empty()) continue;
    if (layout.height > 0.0) layout.height += margin;
    double x = 0.5 * (layout.width - row.width);
    for (const Plane* const plane : row.planes) {
      const double top = layout.height + 0.5 * (row.height - plane->extent.height);
      lay_out(wall, *plane, x, top, layout.boxes);
      layout.planes[static_cast<std::size_t>(plane - planes.data())] = {x, top, plane->extent.width,
                                                                        plane->extent.height};
      x += plane->extent.width + margin;
    }
    layout.height += row.height;
  }
  return layout;
}

/// Half pixels round up, also when arithmetic left them a little short.
int rounded(double value) {
  return static_cast<int>(std::floor(value + 0.5 + 1e-6));
}

Rect rounded(const Box& box, double per_metre) {
  return {rounded(box.x * per_metre), rounded(box.y * per_metre), rounded((box.x + box.width) * per_metre),
          rounded((box.y + box.height) * per_metre)};
}

}  // namespace

std::vector<std::vector<std::size_t>> wall_planes(const Wall& wall) {
  std::vector<std::vector<std::size_t>> planes;
  for (std::size_t i = 0; i < wall.screens.size(); ++i) {
    const auto plane = std::ranges::find_if(
        planes, [&](const auto& p) { return same_plane(wall.screens[p.front()], wall.screens[i]); });
    if (plane == planes.end()) {
      planes.push_back({i});
    } else {
      plane->push_back(i);
    }
  }
  const glm::dvec3 ahead = -wall_extent(wall).axes[2];
  std::vector<std::pair<double, std::vector<std::size_t>>> headed;
  headed.reserve(planes.size());
  for (auto& plane : planes) {
    const double heading =
        heading_of(wall_extent(screens_of(wall, plane)).center - wall.viewers.front().position, ahead);
    headed.emplace_back(heading, std::move(plane));
  }
  std::ranges::stable_sort(headed, {}, [](const auto& plane) { return plane.first; });
  std::ranges::transform(headed, planes.begin(), [](auto& plane) { return std::move(plane.second); });
  return planes;
}

std::vector<WallScreen> screens_of(const Wall& wall, const std::vector<std::size_t>& indices) {
  std::vector<WallScreen> screens;
  screens.reserve(indices.size());
  for (const std::size_t i : indices) screens.push_back(wall.screens.at(i));
  return screens;
}

WallPicture wall_picture(const Wall& wall, int max_side) {
  HPR_CHECK(max_side > 0);
  const Layout layout = layout_of(wall);
  const double finest = finest_pitch(wall);
  const double longest = std::max(layout.width, layout.height) / finest;
  const bool scaled = std::ceil(longest) > max_side;
  const double per_metre = scaled ? max_side / (longest * finest) : 1.0 / finest;
  const bool native = !scaled && std::ranges::all_of(wall.screens, [&](const WallScreen& screen) {
    return std::abs(pixel_pitch(screen) - finest) < 1e-9 * finest;
  });

  WallPicture picture;
  picture.size = {std::max(1, rounded(layout.width * per_metre)), std::max(1, rounded(layout.height * per_metre))};
  for (std::size_t i = 0; i < layout.boxes.size(); ++i) {
    const Box& box = layout.boxes[i];
    const Size pixels = wall.screens[i].pixels;
    Rect rect = rounded(box, per_metre);
    // Rounding moves whole screens then, and never squeezes one by a pixel.
    const bool upright = std::abs(box.width - screen_width(wall.screens[i])) < 1e-6 * box.width;
    if (native && upright) rect = {rect.x0, rect.y0, rect.x0 + pixels.width, rect.y0 + pixels.height};
    rect.x1 = std::max(rect.x1, rect.x0 + 1);
    rect.y1 = std::max(rect.y1, rect.y0 + 1);
    picture.size.width = std::max(picture.size.width, rect.x1);
    picture.size.height = std::max(picture.size.height, rect.y1);
    picture.screens.push_back(rect);
  }
  for (const Box& box : layout.planes) {
    picture.planes.push_back(intersection(rounded(box, per_metre), {0, 0, picture.size.width, picture.size.height}));
  }
  return picture;
}

}  // namespace hpr
