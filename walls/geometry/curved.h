#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "scene/view.h"
#include "walls/config/wall.h"
#include "walls/geometry/warping.h"

namespace hpr {

/// A screen's points as an eye at `eye` (wall space) sees them, along the axes of the screen's corners.
[[nodiscard]] PixelPoints pixel_points(const WallScreen& screen, const glm::dvec3& eye);

/// The view, through the plane between its edges, on `pixels`, of all that the points of `view` show: what OpenGL draws
/// for a screen that is no plane. `view` itself where none of its points is seen.
[[nodiscard]] View flat_view(const View& view, Size pixels);

/// The pixels of a flat_view() none of which is larger than what the view's pixels cover where they cover least; at
/// most twice the larger side of the view's own.
[[nodiscard]] Size flat_pixels(const View& view);

/// How a wall's screens that are no plane are drawn: by rays through their points, or by OpenGL as flat pictures, of
/// which each pixel then shows the place at which the eye sees its point.
class CurvedScreens {
 public:
  /// `views`: the wall's pictures as first seen.
  CurvedScreens(std::span<const View> views, bool by_rays);

  /// Pixels of the pictures to draw.
  [[nodiscard]] const std::vector<Size>& sizes() const { return sizes_; }
  /// What is to be drawn for these views of the same pictures.
  [[nodiscard]] std::vector<View> drawn(std::vector<View> views);
  /// Makes what was drawn, for `views`, what the screens show; empty pictures stay.
  void finish(std::span<const View> views, std::vector<Image<Rgba8>>& pictures, int threads);

 private:
  /// Stays the same as long as the eye does.
  struct CachedView {
    PixelPoints from;
    View flat;
    Image<SourcePosition> positions;  ///< empty: not asked for yet
  };

  /// What is kept of one picture, made anew where the eye of `view` is another one than before.
  CachedView& cached_view(std::size_t picture, const View& view);

  bool by_rays_;
  std::vector<Size> sizes_;
  std::vector<std::optional<CachedView>> cached_views_;
};

/// Per pixel of the screen of `view` where its point is seen in the picture of `flat`; kNoSource where it has none.
[[nodiscard]] Image<SourcePosition> curved_sources(const View& view, const View& flat, int threads);

/// What a warped screen's position map looks like to its viewer at rest.
struct CurveFigures {
  double width_degrees = 0.0;  ///< covered, along the axes of the screen's corners
  double height_degrees = 0.0;
  Size flat_pixels;  ///< of the picture OpenGL draws
};

/// What one wants to know about a screen with a warp.
struct WarpFigures {
  std::size_t screen = 0;             ///< index into Wall::screens
  double lit = 1.0;                   ///< fraction of its pixels
  std::size_t mesh_size = 0;          ///< points or triangles of its mesh; 0: it has none
  std::optional<CurveFigures> curve;  ///< of a position map
};

/// The figures of each screen with a warp.
[[nodiscard]] std::vector<WarpFigures> warp_figures(const Wall& wall);

}  // namespace hpr
