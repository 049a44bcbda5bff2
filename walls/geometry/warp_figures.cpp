#include "walls/geometry/warp_figures.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "walls/geometry/curved.h"
#include "walls/geometry/geometry.h"
#include "walls/geometry/warp_mesh.h"

namespace hpr {
namespace {

CurveFigures curve_of(const Wall& wall, const WallScreen& screen) {
  constexpr double kDegree = std::numbers::pi / 180.0;
  const WallViewer& viewer = wall.viewers.at(screen.viewer);
  View view;
  view.screen = screen.pixels;
  view.points = pixel_points(screen, eye_position(viewer, {viewer.position}, screen.eye));
  const View flat = flat_view(view, view.screen);
  return {(std::atan(flat.right) - std::atan(flat.left)) / kDegree,
          (std::atan(flat.top) - std::atan(flat.bottom)) / kDegree, flat_pixels(view)};
}

}  // namespace

std::vector<WarpFigures> warp_figures(const Wall& wall) {
  std::vector<WarpFigures> all;
  for (std::size_t i = 0; i < wall.screens.size(); ++i) {
    const WallScreen& screen = wall.screens[i];
    if (!screen.warp.any()) continue;
    WarpFigures& figures = all.emplace_back();
    figures.screen = i;
    std::size_t lit = screen.pixels.area();
    if (screen.warp.grid) {
      const Image<SourcePlace> sources = mesh_sources(*screen.warp.grid, screen.pixels);
      lit -= static_cast<std::size_t>(std::ranges::count(sources.pixels(), kNoSource));
      figures.mesh_size = screen.warp.grid->triangles.size();
    }
    if (screen.warp.points) {
      figures.curve = curve_of(wall, screen);
      figures.mesh_size = screen.warp.points->size().area();
      for (int y = 0; y < screen.pixels.height; ++y) {
        for (int x = 0; x < screen.pixels.width; ++x) {
          const double s = (x + 0.5) / screen.pixels.width;
          if (!screen.warp.points->at(s, (y + 0.5) / screen.pixels.height)) --lit;
        }
      }
    }
    figures.lit = static_cast<double>(lit) / static_cast<double>(screen.pixels.area());
  }
  return all;
}

}  // namespace hpr
