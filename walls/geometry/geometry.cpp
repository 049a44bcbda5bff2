#include "walls/geometry/geometry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>
#include <variant>

#include "image/image.h"
#include "walls/geometry/curved.h"

namespace hpr {
namespace {

bool puts_two_on_one(StereoMode mode) {
  return mode == StereoMode::SideBySide || mode == StereoMode::TopBottom || mode == StereoMode::Anaglyph;
}

/// The up direction of a plane with normal `n`: y as far as it lies in the plane, else the fallback's.
glm::dvec3 up_in_plane(const glm::dvec3& n, const glm::dvec3& fallback) {
  constexpr double kNearlyParallel = 0.9;
  const glm::dvec3 up = std::abs(n.y) < kNearlyParallel ? glm::dvec3(0.0, 1.0, 0.0) : fallback;
  const glm::dvec3 inside = up - n * glm::dot(up, n);
  return glm::normalize(inside);
}

std::array<glm::dvec3, 4> corners_of(const WallScreen& screen) {
  return {screen.lower_left, screen.lower_right, screen.upper_left,
          screen.lower_right + (screen.upper_left - screen.lower_left)};
}

/// Wall space as the camera sees it: a rotation about a point that is at the camera's eye.
struct Placement {
  glm::dmat3 world_from_wall{1.0};
  glm::dvec3 anchor{0.0};
  /// The viewer is where the anchor is, with the head turned like this; none: where the wall file or a tracker says.
  std::optional<glm::dquat> facing;
  double height = 0.0;  ///< metres of wall an orthographic camera's height covers
};

Placement place_viewer(const Wall& wall, const WallExtent& extent, const Camera& camera) {
  const WallViewer& first = wall.viewers.front();
  if (first.has_position || !extent.flat) return {camera.axes, first.position, std::nullopt, extent.height};
  double distance = extent.height;
  if (const auto* const lens = std::get_if<PerspectiveLens>(&camera.lens)) {
    distance = 0.5 * extent.height / std::tan(0.5 * lens->vertical_fov_radians);
  }
  return {camera.axes * glm::transpose(extent.axes), extent.center + extent.axes[2] * distance,
          glm::quat_cast(extent.axes), extent.height};
}

/// `shared` holds what all screens share; `eye` is in wall space.
View screen_view(const View& shared, const WallScreen& screen, const Placement& placement, const glm::dvec3& eye,
                 double clamp) {
  const glm::dmat3 axes = screen_axes(screen);
  const glm::dvec3 from_eye = screen.lower_left - eye;
  View view = shared;
  view.eye += placement.world_from_wall * (eye - placement.anchor);
  view.axes = placement.world_from_wall * axes;

  double scale = 1.0;
  if (view.orthographic) {
    scale = (shared.top - shared.bottom) / placement.height;
  } else {
    const double distance = -glm::dot(from_eye, axes[2]);
    const double held = std::max(distance, clamp);
    // Moving the eye, not only dividing by another number, keeps what lies in the screen's plane where it is. Of points
    // none need lie there.
    if (!screen.warp.points) view.eye += view.axes[2] * (held - distance);
    scale = 1.0 / held;
  }
  view.left = glm::dot(from_eye, axes[0]) * scale;
  view.right = (glm::dot(from_eye, axes[0]) + screen_width(screen)) * scale;
  view.bottom = glm::dot(from_eye, axes[1]) * scale;
  view.top = (glm::dot(from_eye, axes[1]) + screen_height(screen)) * scale;
  if (screen.warp.points) {
    view.points = pixel_points(screen, eye);
    view.points->orthographic = view.orthographic;
    view.points->scale = view.orthographic ? scale : 1.0;
  }
  return view;
}

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

/// The angle from straight ahead, clockwise seen from above, in radians.
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

Rect rounded(const Box& box, double per_meter) {
  return {rounded(box.x * per_meter), rounded(box.y * per_meter), rounded((box.x + box.width) * per_meter),
          rounded((box.y + box.height) * per_meter)};
}

/// A screen in the plane of the wall, in metres.
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

bool for_other_eyes(const WallScreen& a, const WallScreen& b) {
  return a.eye != Eye::Both && b.eye != Eye::Both && a.eye != b.eye;
}

std::vector<ScreenEye> screen_eyes(const Wall& wall) {
  std::vector<ScreenEye> pictures;
  for (std::size_t i = 0; i < wall.screens.size(); ++i) {
    const WallScreen& screen = wall.screens[i];
    if (screen.eye != Eye::Both || !puts_two_on_one(wall.stereo)) {
      pictures.push_back({i, screen.eye, screen.pixels});
      continue;
    }
    Size left = screen.pixels;
    if (wall.stereo == StereoMode::SideBySide) left.width /= 2;
    if (wall.stereo == StereoMode::TopBottom) left.height /= 2;
    Size right = screen.pixels;
    if (wall.stereo == StereoMode::SideBySide) right.width -= left.width;
    if (wall.stereo == StereoMode::TopBottom) right.height -= left.height;
    pictures.push_back({i, Eye::Left, left});
    pictures.push_back({i, Eye::Right, right});
  }
  return pictures;
}

std::vector<Rect> eye_rects(const Wall& wall, std::size_t screen) {
  const Size size = wall.screens.at(screen).pixels;
  std::vector<Rect> rects;
  for (const ScreenEye& picture : screen_eyes(wall)) {
    if (picture.screen != screen) continue;
    if (picture.pixels == size) return {{0, 0, size.width, size.height}};
    const bool first = rects.empty();
    const int x = first ? 0 : size.width - picture.pixels.width;
    const int y = first ? 0 : size.height - picture.pixels.height;
    rects.push_back({x, y, x + picture.pixels.width, y + picture.pixels.height});
  }
  return rects;
}

Image<Rgba8> compose_eyes(StereoMode mode, const Image<Rgba8>& left, const Image<Rgba8>& right) {
  HPR_CHECK(puts_two_on_one(mode));
  if (mode == StereoMode::SideBySide) {
    HPR_CHECK(left.height() == right.height());
    Image<Rgba8> result({left.width() + right.width(), left.height()});
    paste(left, 0, 0, result);
    paste(right, left.width(), 0, result);
    return result;
  }
  if (mode == StereoMode::TopBottom) {
    HPR_CHECK(left.width() == right.width());
    Image<Rgba8> result({left.width(), left.height() + right.height()});
    paste(left, 0, 0, result);
    paste(right, 0, left.height(), result);
    return result;
  }
  HPR_CHECK(left.size() == right.size());
  Image<Rgba8> result = right;
  std::ranges::transform(left.pixels(), right.pixels(), result.pixels().begin(), [](Rgba8 l, Rgba8 r) {
    return Rgba8{l.r, r.g, r.b, r.a};
  });
  return result;
}

std::vector<Image<Rgba8>> compose_screens(const Wall& wall, std::vector<Image<Rgba8>> pictures) {
  const std::vector<ScreenEye> eyes = screen_eyes(wall);
  HPR_CHECK(eyes.size() == pictures.size());
  std::vector<Image<Rgba8>> screens(wall.screens.size());
  for (std::size_t i = 0; i < eyes.size(); ++i) {
    const bool two = i + 1 < eyes.size() && eyes[i + 1].screen == eyes[i].screen;
    Image<Rgba8>& shown = screens[eyes[i].screen];
    if (!two) {
      shown = std::move(pictures[i]);
      continue;
    }
    const bool here = pictures[i].size().area() > 0 && pictures[i + 1].size().area() > 0;
    if (here) shown = compose_eyes(wall.stereo, pictures[i], pictures[i + 1]);
    ++i;
  }
  return screens;
}

glm::dmat3 screen_axes(const WallScreen& screen) {
  const glm::dvec3 right = glm::normalize(screen.lower_right - screen.lower_left);
  const glm::dvec3 back = glm::normalize(glm::cross(right, screen.upper_left - screen.lower_left));
  return {right, glm::cross(back, right), back};
}

glm::dvec3 screen_center(const WallScreen& screen) {
  return 0.5 * (screen.lower_right + screen.upper_left);
}

double pixel_pitch(const WallScreen& screen) {
  return screen_width(screen) / screen.pixels.width;
}

double finest_pitch(const Wall& wall) {
  double finest = std::numeric_limits<double>::infinity();
  for (const WallScreen& screen : wall.screens) finest = std::min(finest, pixel_pitch(screen));
  return finest;
}

WallExtent wall_extent(std::span<const WallScreen> screens) {
  HPR_CHECK(!screens.empty());
  constexpr double kFlatness = 1e-6;
  WallExtent extent;
  glm::dvec3 normal(0.0);
  for (const WallScreen& screen : screens) {
    normal += screen_axes(screen)[2];
    extent.centroid += screen_center(screen) / static_cast<double>(screens.size());
  }
  // Screens all round the viewer cancel out; then the first one says where the front is.
  const glm::dmat3 first = screen_axes(screens.front());
  const bool has_front = glm::length(normal) > 0.1 * static_cast<double>(screens.size());
  extent.axes[2] = has_front ? glm::normalize(normal) : first[2];
  const bool first_up_usable = std::abs(glm::dot(first[1], extent.axes[2])) < 0.9;
  extent.axes[1] = up_in_plane(extent.axes[2], first_up_usable ? first[1] : first[0]);
  extent.axes[0] = glm::cross(extent.axes[1], extent.axes[2]);

  glm::dvec3 low(std::numeric_limits<double>::infinity());
  glm::dvec3 high = -low;
  const glm::dmat3 extent_from_wall = glm::transpose(extent.axes);
  for (const WallScreen& screen : screens) {
    for (const glm::dvec3& corner : corners_of(screen)) {
      // Relative to the middle, so that a wall far from the origin loses no digits.
      const glm::dvec3 inside = extent_from_wall * (corner - extent.centroid);
      low = glm::min(low, inside);
      high = glm::max(high, inside);
    }
    if (glm::dot(screen_axes(screen)[2], extent.axes[2]) < 1.0 - kFlatness) extent.flat = false;
  }
  extent.width = high.x - low.x;
  extent.height = high.y - low.y;
  if (high.z - low.z > kFlatness * (extent.width + extent.height)) extent.flat = false;
  extent.center = extent.centroid + extent.axes * (0.5 * (low + high));
  return extent;
}

std::vector<HeadPose> resting_heads(const Wall& wall) {
  std::vector<HeadPose> heads;
  for (const WallViewer& viewer : wall.viewers) heads.push_back({viewer.position});
  return heads;
}

glm::dvec3 eye_position(const WallViewer& viewer, const HeadPose& head, Eye eye) {
  const double side = eye == Eye::Left ? -0.5 : eye == Eye::Right ? 0.5 : 0.0;
  const glm::dvec3 inside = viewer.eye_offset + glm::dvec3(side * viewer.ipd_m, 0.0, 0.0);
  // A head that looks straight ahead loses no digit to the quaternion.
  return head.position + (head.orientation == glm::dquat(1.0, 0.0, 0.0, 0.0) ? inside : head.orientation * inside);
}

std::vector<View> wall_views(const Wall& wall, std::span<const HeadPose> heads, const Camera& camera,
                             const Bounds& bounds) {
  HPR_CHECK(heads.size() == wall.viewers.size());
  const WallExtent extent = wall_extent(wall);
  const Placement placement = place_viewer(wall, extent, camera);
  View shared = make_view(camera, {1, 1}, bounds);
  if (const auto* const box = std::get_if<OrthographicLens>(&camera.lens)) {  // in the shape of the wall, all of it
    shared.top = std::max(box->half_height, box->half_width * extent.height / extent.width);
    shared.bottom = -shared.top;
    shared.near_distance = box->near_distance;  // each screen has its own way to the scene
    shared.far_distance = box->far_distance;
  }
  std::vector<View> views;
  for (const ScreenEye& picture : screen_eyes(wall)) {
    const WallScreen& screen = wall.screens[picture.screen];
    const WallViewer& viewer = wall.viewers.at(screen.viewer);
    HeadPose head = heads[screen.viewer];
    if (placement.facing) head = {placement.anchor, *placement.facing};
    const glm::dvec3 eye = shared.orthographic ? placement.anchor : eye_position(viewer, head, picture.eye);
    View view = screen_view(shared, screen, placement, eye, viewer.clamp_distance_m);
    if (viewer.near_m > 0.0 && !shared.orthographic) view.near_distance = viewer.near_m;
    tighten(view, bounds);
    view.screen = picture.pixels;
    view.block = {0, 0, picture.pixels.width, picture.pixels.height};
    view.screen_number = static_cast<std::uint32_t>(views.size());
    views.push_back(view);
  }
  return views;
}

std::vector<View> wall_views(const Wall& wall, const Camera& camera, const Bounds& bounds) {
  return wall_views(wall, resting_heads(wall), camera, bounds);
}

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
  const double per_meter = scaled ? max_side / (longest * finest) : 1.0 / finest;
  const bool native = !scaled && std::ranges::all_of(wall.screens, [&](const WallScreen& screen) {
    return std::abs(pixel_pitch(screen) - finest) < 1e-9 * finest;
  });

  WallPicture picture;
  picture.size = {std::max(1, rounded(layout.width * per_meter)), std::max(1, rounded(layout.height * per_meter))};
  for (std::size_t i = 0; i < layout.boxes.size(); ++i) {
    const Box& box = layout.boxes[i];
    const Size pixels = wall.screens[i].pixels;
    Rect rect = rounded(box, per_meter);
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
    picture.planes.push_back(intersection(rounded(box, per_meter), {0, 0, picture.size.width, picture.size.height}));
  }
  return picture;
}

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
      const bool neighbors = line_of(before) == line_of(box) && std::abs(before.pitch - box.pitch) < 1e-6 * box.pitch;
      if (neighbors) {
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
