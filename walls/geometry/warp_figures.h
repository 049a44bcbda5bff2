#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "walls/config/wall.h"

namespace hpr {

/// What a warped screen's position map looks like to its viewer at rest.
struct CurveFigures {
  double width_degrees = 0.0;  ///< covered, along the axes of the screen's corners
  double height_degrees = 0.0;
  Size flat_pixels;  ///< of the picture OpenGL draws
};

/// What one wants to know about a screen with a warp.
struct WarpFigures {
  std::size_t screen = 0;             ///< index into Wall::screens
  double lit = 1.0;                   ///< share of its pixels
  std::size_t mesh_size = 0;          ///< points or triangles of its mesh; 0: it has none
  std::optional<CurveFigures> curve;  ///< of a position map
};

/// Of each screen with a warp.
[[nodiscard]] std::vector<WarpFigures> warp_figures(const Wall& wall);

}  // namespace hpr
