#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "scene/view.h"
#include "walls/config/wall.h"
#include "walls/tracking/head_path.h"

namespace hpr {

/// A picture to draw: of a screen, for an eye.
struct ScreenEye {
  std::size_t screen = 0;  ///< index into Wall::screens
  Eye eye = Eye::Both;
  Size pixels;

  bool operator==(const ScreenEye&) const = default;
};

/// Whether each of the two screens is for an eye of its own.
[[nodiscard]] bool for_other_eyes(const WallScreen& a, const WallScreen& b);

/// The pictures a wall needs, screen after screen: one each, but the left and then the right eye's of screens for both
/// where the stereo mode puts two pictures on one panel. Side by side and above each other each has half of the
/// screen's pixels, the left (upper) one the smaller half.
[[nodiscard]] std::vector<ScreenEye> screen_eyes(const Wall& wall);

/// Which parts of a screen's pixels its pictures take, in the order of screen_eyes(); one part where they share it.
[[nodiscard]] std::vector<Rect> eye_rects(const Wall& wall, std::size_t screen);

/// What the screen shows of two eyes' pictures of the sizes of screen_eyes(). Anaglyph: red of the left eye, green and
/// blue of the right one.
[[nodiscard]] Image<Rgba8> compose_eyes(StereoMode mode, const Image<Rgba8>& left, const Image<Rgba8>& right);

/// Per screen what it shows, of the pictures of screen_eyes(); empty where one of them is.
[[nodiscard]] std::vector<Image<Rgba8>> compose_screens(const Wall& wall, std::vector<Image<Rgba8>> pictures);

/// The rectangle all screens lie in, seen along their mean normal.
struct WallExtent {
  glm::dmat3 axes{1.0};      ///< columns: right, up, towards the viewer; wall space, orthonormal
  glm::dvec3 center{0.0};    ///< of the rectangle, wall space
  double width = 0.0;        ///< metres
  double height = 0.0;       ///< metres
  bool flat = true;          ///< all screens face the same way in one plane (to 1e-6 of the extent)
  glm::dvec3 centroid{0.0};  ///< mean of the screens' centres, wall space
};

[[nodiscard]] WallExtent wall_extent(std::span<const WallScreen> screens);
[[nodiscard]] inline WallExtent wall_extent(const Wall& wall) {
  return wall_extent(wall.screens);
}

/// Columns: right, up, towards the viewer; orthonormal.
[[nodiscard]] glm::dmat3 screen_axes(const WallScreen& screen);
[[nodiscard]] glm::dvec3 screen_center(const WallScreen& screen);

/// The viewers' heads at rest, one per viewer.
[[nodiscard]] std::vector<HeadPose> resting_heads(const Wall& wall);

/// Wall space. Left and Right lie half of ipd_m along the head's right axis from the middle.
[[nodiscard]] glm::dvec3 eye_position(const WallViewer& viewer, const HeadPose& head, Eye eye);

/// One view per picture of screen_eyes(): off-axis frusta after Kooima, Generalized Perspective Projection, 2008, all
/// in double, each from its own eye of the screen's viewer.
///
/// With a viewer in the file the wall is a window into the scene: the first viewer's head at rest is at the camera's
/// eye, wall axes are the camera's axes, a metre is a unit of the scene, and heads that move move before that window.
/// Without one, a flat wall shows what the camera sees: the viewer is placed so that the wall's height subtends the
/// camera's vertical angle. An orthographic camera's box is shown whole, and more where the wall has another shape,
/// wherever the heads are. `bounds` (of the scene) choose the near plane where neither wall nor camera give one. An eye
/// nearer to a screen's plane than clamp_distance_m, or behind it, is moved back for that screen. A screen with a
/// position map is looked at through its points, by an eye that stays where it is.
[[nodiscard]] std::vector<View> wall_views(const Wall& wall, std::span<const HeadPose> heads, const Camera& camera,
                                           const Bounds& bounds);
/// The views of heads at rest.
[[nodiscard]] std::vector<View> wall_views(const Wall& wall, const Camera& camera, const Bounds& bounds);

/// Screens (by index) that lie in one plane and face the same way; plane after plane from left to right as the viewer
/// turns, screens in the wall's order.
[[nodiscard]] std::vector<std::vector<std::size_t>> wall_planes(const Wall& wall);

/// The screens with these indices.
[[nodiscard]] std::vector<WallScreen> screens_of(const Wall& wall, const std::vector<std::size_t>& indices);

/// Where the screens lie in a picture of the whole wall.
struct WallPicture {
  Size size;
  std::vector<Rect> screens;  ///< one per screen of the wall, none empty
  std::vector<Rect> planes;   ///< what each of wall_planes() covers, gaps included
};

/// Pixels a side of an assembled wall that is looked at, or encoded: most programs take no larger picture well.
inline constexpr int kMaxPictureSide = 8192;

/// A flat wall as it stands, at its finest screen's pixels; any other wall plane by plane: upright ones side by side
/// from left to right, ceilings above, floors below. Scaled down when a side would exceed `max_side` pixels. Edges are
/// rounded to whole pixels; where all screens have one pitch, and nothing is scaled, each keeps its size.
[[nodiscard]] WallPicture wall_picture(const Wall& wall, int max_side);

/// What lies between neighbours of one pitch in the rows and columns of a flat wall, and how far that is from whole
/// pixels: the error a wall description with bezels in whole pixels would make.
struct WallSeams {
  int count = 0;
  double narrowest_m = 0.0;  ///< negative: overlap
  double widest_m = 0.0;
  double largest_error_px = 0.0;      ///< at one seam
  double accumulated_error_px = 0.0;  ///< over a row or column of seams
};
[[nodiscard]] WallSeams wall_seams(const Wall& wall);

/// Metres per pixel along the screen's width.
[[nodiscard]] double pixel_pitch(const WallScreen& screen);

/// Metres per pixel of the screen with the smallest pixels.
[[nodiscard]] double finest_pitch(const Wall& wall);

}  // namespace hpr
