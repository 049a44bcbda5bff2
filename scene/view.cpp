#include "scene/view.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat4x3.hpp>
#include <limits>
#include <numbers>

#include "core/error.h"

namespace hpr {
namespace {

double near_plane(const PerspectiveLens& lens, const Bounds& bounds) {
  if (lens.near_distance > 0.0) return lens.near_distance;
  const double extent = glm::length(bounds.high - bounds.low);
  const double small = extent > 0.0 && std::isfinite(extent) ? 1e-4 * extent : 0.01;
  // A sky dome is no reason to cut away what stands close by.
  const double close = 0.01 * lens.at_distance;
  return close > 0.0 ? std::min(small, close) : small;
}

/// What (x, y) of the view looks through, on the plane its edges are on.
glm::dvec2 screen_position(const View& view, double x, double y) {
  const auto fraction = [&](const glm::dvec2& jitter) {
    return glm::dvec2((view.block.x0 + x + jitter.x) / view.screen.width,
                      (view.block.y0 + y + jitter.y) / view.screen.height);
  };
  const glm::dvec2 at = fraction(view.jitter);
  if (view.points) {
    if (const auto seen = view.points->seen_at(at.x, at.y)) return *seen;
    const glm::dvec2 center = fraction(glm::dvec2(0.0));
    if (const auto seen = view.points->seen_at(center.x, center.y)) return *seen;
  }
  return {view.left + (view.right - view.left) * at.x, view.top - (view.top - view.bottom) * at.y};
}

}  // namespace

Ray view_ray(const View& view, double x, double y) {
  const glm::dvec2 position = screen_position(view, x, y);
  if (view.orthographic) return {view.eye + view.axes * glm::dvec3(position, 0.0), -view.axes[2]};
  return {view.eye, view.axes * glm::dvec3(position, -1.0)};
}

glm::dmat4 clip_from_world(const View& view, const glm::dvec3& origin) {
  const double width = view.right - view.left;
  const double height = view.top - view.bottom;
  const double l = view.left + width * (view.block.x0 + view.jitter.x) / view.screen.width;
  const double r = view.left + width * (view.block.x1 + view.jitter.x) / view.screen.width;
  const double t = view.top - height * (view.block.y0 + view.jitter.y) / view.screen.height;
  const double b = view.top - height * (view.block.y1 + view.jitter.y) / view.screen.height;

  glm::dmat4 clip_from_eye(0.0);  // glm: [column][row]
  clip_from_eye[0][0] = 2.0 / (r - l);
  clip_from_eye[1][1] = 2.0 / (t - b);
  if (view.orthographic) {
    clip_from_eye[3][0] = -(r + l) / (r - l);
    clip_from_eye[3][1] = -(t + b) / (t - b);
    const double range = view.far_distance - view.near_distance;
    clip_from_eye[2][2] = 1.0 / range;
    clip_from_eye[3][2] = view.far_distance / range;
    clip_from_eye[3][3] = 1.0;
  } else {
    clip_from_eye[2][0] = (r + l) / (r - l);
    clip_from_eye[2][1] = (t + b) / (t - b);
    clip_from_eye[3][2] = view.near_distance;
    clip_from_eye[2][3] = -1.0;
  }
  const glm::dmat3 eye_from_world = glm::transpose(view.axes);
  glm::dmat4 eye_from_origin(eye_from_world);
  eye_from_origin[3] = glm::dvec4(eye_from_world * (origin - view.eye), 1.0);
  return clip_from_eye * eye_from_origin;
}

double reversed_depth(const View& view, double distance) {
  if (view.orthographic) return (view.far_distance - distance) / (view.far_distance - view.near_distance);
  return view.near_distance / distance;
}

double view_distance(const View& view, double depth) {
  if (view.orthographic) return view.far_distance - depth * (view.far_distance - view.near_distance);
  return view.near_distance / depth;
}

void tighten(View& view, const Bounds& bounds) {
  if (!view.orthographic) return;
  const glm::dvec3 extent = bounds.high - bounds.low;
  const double diagonal = glm::length(extent);
  if (!(diagonal > 0.0) || !std::isfinite(diagonal)) return;
  const double center = glm::dot(view.eye - 0.5 * (bounds.low + bounds.high), view.axes[2]);
  const double half = 0.5 * glm::dot(extent, glm::abs(view.axes[2]));
  const double margin = 1e-3 * diagonal + 1e-6 * std::abs(center);  // what drawing in single precision may shift
  const double near = std::max(view.near_distance, center - half - margin);
  const double far = std::min(view.far_distance, center + half + margin);
  if (!(near < far)) return;
  view.near_distance = near;
  view.far_distance = far;
}

View make_view(const Camera& camera, Size size, const Bounds& bounds) {
  HPR_CHECK(size.width > 0 && size.height > 0);
  View view;
  view.eye = camera.eye;
  view.axes = camera.axes;
  view.screen = size;
  view.block = {0, 0, size.width, size.height};
  const double aspect = static_cast<double>(size.width) / size.height;
  double half_height = 1.0;
  if (const auto* const lens = std::get_if<PerspectiveLens>(&camera.lens)) {
    half_height = std::tan(0.5 * lens->vertical_fov_radians);
    view.near_distance = near_plane(*lens, bounds);
  } else {
    const auto& box = std::get<OrthographicLens>(camera.lens);
    half_height = std::max(box.half_height, box.half_width / aspect);
    view.orthographic = true;
    view.near_distance = box.near_distance;
    view.far_distance = box.far_distance;
    tighten(view, bounds);
  }
  view.top = half_height;
  view.bottom = -half_height;
  view.right = half_height * aspect;
  view.left = -view.right;
  return view;
}

Camera look_at(const glm::dvec3& eye, const glm::dvec3& at, const glm::dvec3& up, double vertical_fov_radians) {
  const glm::dvec3 back = eye - at;
  const glm::dvec3 right = glm::cross(up, back);
  if (!(glm::length(back) > 0.0) || !(glm::length(right) > 1e-12 * glm::length(up) * glm::length(back))) {
    throw Error(ExitCode::Usage, "the camera has no direction: eye and target coincide, or up points along the view",
                "choose --eye, --at and --up so that they span a plane");
  }
  Camera camera;
  camera.name = "look-at";
  camera.eye = eye;
  camera.axes[2] = glm::normalize(back);
  camera.axes[0] = glm::normalize(right);
  camera.axes[1] = glm::cross(camera.axes[2], camera.axes[0]);
  camera.lens = PerspectiveLens{.vertical_fov_radians = vertical_fov_radians, .at_distance = glm::length(back)};
  return camera;
}

namespace {

/// Where a camera stands whose picture points fill up to a margin, and which looks along -z of `axes`: at each point's
/// distance from the eye both x and y are at most `slope` times that from the middle. Each point bounds four planes
/// through the eye, and the furthest of each kind settle its place.
class Framing {
 public:
  Framing(const glm::dmat3& axes, double slope) : to_camera_(glm::transpose(axes)), slope_(slope) {}

  void add(const glm::dvec3& point) {
    const glm::dvec3 at = to_camera_ * point;
    const glm::dvec2 beside(at);
    above_ = glm::max(above_, beside + slope_ * at.z);
    below_ = glm::max(below_, slope_ * at.z - beside);
  }

  [[nodiscard]] SceneFraming::Extremes extremes() const { return {above_.x, above_.y, below_.x, below_.y}; }
  void add(const SceneFraming::Extremes& others) {
    above_ = glm::max(above_, glm::dvec2(others[0], others[1]));
    below_ = glm::max(below_, glm::dvec2(others[2], others[3]));
  }

  [[nodiscard]] glm::dvec3 eye() const {
    const glm::dvec2 midpoint = 0.5 * (above_ - below_);
    const glm::dvec2 back = 0.5 / slope_ * (above_ + below_);
    return glm::transpose(to_camera_) * glm::dvec3(midpoint, std::max(back.x, back.y));
  }

 private:
  glm::dmat3 to_camera_;
  double slope_;
  glm::dvec2 above_{-std::numeric_limits<double>::infinity()};
  glm::dvec2 below_{-std::numeric_limits<double>::infinity()};
};

/// From where a box is seen best; any length.
glm::dvec3 side_to_see(const glm::dvec3& extent) {
  constexpr double kFlat = 0.1;
  if (extent.y < kFlat * std::min(extent.x, extent.z)) return {0.35, 0.9, 1.0};
  if (extent.x < kFlat * std::min(extent.y, extent.z)) return {1.0, 0.25, 0.35};
  return {0.35, 0.25, 1.0};
}

}  // namespace

/// A camera that is to see some points inside of a box.
class SceneFraming::PointsFraming {
 public:
  explicit PointsFraming(const Bounds& bounds)
      : extent_(bounds.high - bounds.low),
        center_(0.5 * (bounds.low + bounds.high)),
        is_finite_(std::isfinite(glm::length(extent_))),
        from_(glm::normalize(side_to_see(is_finite_ ? extent_ : glm::dvec3(1.0)))),
        camera_(look_at(from_, glm::dvec3(0.0), {0.0, 1.0, 0.0}, kFov)),
        framing_(camera_.axes, std::tan(0.5 * kFov) / kMargin) {}

  void add(const glm::dvec3& point) {
    if (is_finite_) framing_.add(point);
  }
  [[nodiscard]] Extremes extremes() const { return framing_.extremes(); }
  void add(const Extremes& others) { framing_.add(others); }

  [[nodiscard]] Camera camera() const {
    Camera camera = camera_;
    const glm::dvec3 eye = framing_.eye();
    // Else all is one point, or nothing.
    const double size = glm::length(extent_);
    const bool stands_off =
        size > 0.0 && std::isfinite(glm::length(eye)) && glm::dot(eye - center_, from_) > 0.1 * size;
    camera.eye = stands_off ? eye : center_ + from_;
    std::get<PerspectiveLens>(camera.lens).at_distance = 0.0;  // the whole scene, which is in the bounds
    camera.name = "framing";
    return camera;
  }

 private:
  static constexpr double kFov = 40.0 * std::numbers::pi / 180.0;
  static constexpr double kMargin = 1.05;

  glm::dvec3 extent_;
  glm::dvec3 center_;
  bool is_finite_;
  glm::dvec3 from_;
  Camera camera_;
  Framing framing_;
};

SceneFraming::SceneFraming(const Bounds& bounds) : points_(std::make_unique<PointsFraming>(bounds)) {}
SceneFraming::~SceneFraming() = default;

void SceneFraming::add(const Instance& instance, const Mesh& mesh) {
  const glm::dmat4x3 to_world(instance.to_world);
  for (const glm::vec3& position : mesh.positions) points_->add(to_world * glm::dvec4(position, 1.0));
}

void SceneFraming::add(const glm::dvec3& point) {
  points_->add(point);
}

SceneFraming::Extremes SceneFraming::extremes() const {
  return points_->extremes();
}

void SceneFraming::add(const Extremes& others) {
  points_->add(others);
}

Camera SceneFraming::camera() const {
  return points_->camera();
}

Camera framing_camera(const Bounds& bounds) {
  SceneFraming framing(bounds);
  for (int corner = 0; corner < 8; ++corner) {
    framing.add(glm::dvec3{(corner & 1) != 0 ? bounds.high.x : bounds.low.x,
                           (corner & 2) != 0 ? bounds.high.y : bounds.low.y,
                           (corner & 4) != 0 ? bounds.high.z : bounds.low.z});
  }
  return framing.camera();
}

Camera framing_camera(const Scene& scene) {
  if (scene.framing) return *scene.framing;
  SceneFraming framing(scene.bounds);
  for (const Instance& instance : scene.instances) framing.add(instance, scene.mesh_of(instance));
  return framing.camera();
}

std::vector<View> split_into_blocks(const View& view, int limit) {
  HPR_CHECK(limit > 0 && limit % 64 == 0);
  std::vector<View> blocks;
  for (int y = view.block.y0; y < view.block.y1; y += limit) {
    for (int x = view.block.x0; x < view.block.x1; x += limit) {
      View block = view;
      block.block = {x, y, std::min(x + limit, view.block.x1), std::min(y + limit, view.block.y1)};
      blocks.push_back(block);
    }
  }
  return blocks;
}

}  // namespace hpr
