#pragma once

#include <array>
#include <cstdint>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "image/image.h"
#include "scene/position_map.h"
#include "scene/scene.h"

namespace hpr {

/// A screen of the wall as a part of the one that it was joined to (join_screens).
struct JoinedPart {
  std::uint32_t screen_number = 0;  ///< its own
  Rect pixels;                      ///< its own, of the screen they all span
};

/// One screen as an eye sees it, all in double. The screen is the unit of rasterisation: its projection never changes
/// with strategy or rank count, parts of it are drawn by scissor. Screens beyond the raster limit are cut into fixed
/// blocks.
struct View {
  glm::dvec3 eye{0.0};
  glm::dmat3 axes{1.0};  ///< columns: right, up, back; orthonormal
  /// Edges of the whole screen: on the plane one metre before the eye (perspective, off-axis allowed), or in metres
  /// about the eye (orthographic).
  double left = -1.0;
  double right = 1.0;
  double bottom = -1.0;
  double top = 1.0;
  double near_distance = 0.01;
  double far_distance = 0.0;  ///< orthographic only; perspective has its far plane at infinity
  bool orthographic = false;
  Size screen;  ///< pixels of the whole screen
  Rect block;   ///< the part of it this view draws; pixel (x, y) of the view is pixel (block.x0 + x, block.y0 + y)
  std::uint32_t screen_number = 0;  ///< which screen of the wall: its blocks have the same one, and so the same noise
  std::optional<JoinedPart> joined_part;  ///< whose pixels `block` may reach beyond by what enlarging takes
  /// Pixels from its centre, to the right and down, at which every pixel is sampled.
  glm::dvec2 jitter{0.0};
  /// Rays go through these and no longer through the plane between the edges, which is all that rasterising knows.
  std::optional<PixelPoints> points;

  [[nodiscard]] Size size() const { return {block.width(), block.height()}; }
};

struct Ray {
  glm::dvec3 origin{0.0};
  glm::dvec3 direction{0.0};  ///< not normalised: one metre along the view axis (perspective)
};

/// The ray through (x, y) of the view, in pixels from its upper left corner: pixel centres are at + 0.5. The jitter is
/// added to the position, so for a centre it is the ray of that pixel's sample. Where a screen of points has none,
/// it is that of the position without jitter, else that of the plane.
[[nodiscard]] Ray view_ray(const View& view, double x, double y);

/// World relative to `origin` -> clip space, for a depth range of [0, 1] reversed: near is 1, infinity (or the
/// orthographic far plane) is 0. y points up, as GL has it; pixel centres show what
/// lies at the jittered positions. Multiply with model matrices in double before rounding.
[[nodiscard]] glm::dmat4 clip_from_world(const View& view, const glm::dvec3& origin);

/// The depth a point at `distance` metres along the view axis has in keys.
[[nodiscard]] double reversed_depth(const View& view, double distance);
/// The distance that has this depth; infinite for a depth of 0 in perspective.
[[nodiscard]] double view_distance(const View& view, double depth);

/// A camera's view on a screen of `size` pixels. The vertical angle is kept, the horizontal one follows from the
/// aspect; an orthographic camera shows at least its width and its height. near_distance is the camera's, or 1e-4 of
/// the scene's extent; an orthographic camera's planes are moved towards `bounds`, where those hold anything.
[[nodiscard]] View make_view(const Camera& camera, Size size, const Bounds& bounds);

/// Moves an orthographic view's planes up to `bounds`, as far as those hold anything: keys spread their precision
/// evenly from the near one to the far one. Others stay.
void tighten(View& view, const Bounds& bounds);

/// A camera that sees all of `bounds` from the front, a little above and to the right, on screens at least as wide as
/// high: for scenes that have none. What is flat is seen from its larger side: ground from well above, a wall that
/// faces x along x. It is as near as it can be.
[[nodiscard]] Camera framing_camera(const Bounds& bounds);
/// A camera as framing_camera of the bounds, but as near as the surfaces themselves allow.
[[nodiscard]] Camera framing_camera(const Scene& scene);

/// Finds the framing_camera of a scene with these bounds, instance by instance.
class SceneFraming {
 public:
  explicit SceneFraming(const Bounds& bounds);
  ~SceneFraming();
  SceneFraming(const SceneFraming&) = delete;
  SceneFraming& operator=(const SceneFraming&) = delete;

  void add(const glm::dvec3& point);
  void add(const Instance& instance, const Mesh& mesh);
  /// What counts of all that was added, in whatever order, and adds that of another one with the same bounds.
  using Extremes = std::array<double, 4>;
  [[nodiscard]] Extremes extremes() const;
  void add(const Extremes& others);
  [[nodiscard]] Camera camera() const;

 private:
  class PointsFraming;
  std::unique_ptr<PointsFraming> points_;
};

/// A perspective camera at `eye` that looks at `at`. Throws Error (Usage) when they coincide or `up` is parallel.
[[nodiscard]] Camera look_at(const glm::dvec3& eye, const glm::dvec3& at, const glm::dvec3& up,
                             double vertical_fov_radians);

/// Cuts a view into blocks no larger than `limit` pixels a side (a multiple of 64); one block when it already fits.
[[nodiscard]] std::vector<View> split_into_blocks(const View& view, int limit);

/// Screens that one eye sees without a gap as parts of one picture: they lie in one plane, have one grid of pixels (to
/// a sixteenth of a pixel) and touch or overlap. Each becomes a block of the one screen that such a group spans, so
/// that filters go on from one to the other, on one grid and with one screen's noise. Its number is that of the group's
/// first screen. All other screens stay as they are. The order stays.
[[nodiscard]] std::vector<View> join_screens(std::span<const View> screens);

/// The largest side GL draws at once, a multiple of a tile's: llvmpipe clamps larger viewports silently.
inline constexpr int kRasterLimit = 16384;

}  // namespace hpr
