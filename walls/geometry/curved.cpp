#include "walls/geometry/curved.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <limits>
#include <numbers>

#include "core/error.h"
#include "core/parallel.h"
#include "walls/geometry/geometry.h"
#include "walls/geometry/warping.h"

namespace hpr {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A rectangle on the plane pictures are on.
struct ViewBounds {
  glm::dvec2 low{kInfinity};
  glm::dvec2 high{-kInfinity};

  void add(const glm::dvec2& position) {
    low = glm::min(low, position);
    high = glm::max(high, position);
  }
};

/// Widens `seen` to a block's box; false, having changed nothing, where not all of it is seen.
bool add_box(const PixelPoints& points, const Bounds& box, ViewBounds& seen) {
  ViewBounds wider = seen;
  for (unsigned int corner = 0; corner < 8; ++corner) {
    const glm::dvec3 at((corner & 1U) != 0 ? box.high.x : box.low.x, (corner & 2U) != 0 ? box.high.y : box.low.y,
                        (corner & 4U) != 0 ? box.high.z : box.low.z);
    const auto position = points.seen(at);
    if (!position) return false;
    wider.add(*position);
  }
  seen = wider;
  return true;
}

/// `view` on the screen of `flat`, without points.
View flattened(const View& view, const View& flat) {
  View result = view;
  result.points.reset();
  result.screen = flat.screen;
  result.block = flat.block;
  result.left = flat.left;
  result.right = flat.right;
  result.bottom = flat.bottom;
  result.top = flat.top;
  return result;
}

void darken(Image<Rgba8>& picture, const Image<SourcePosition>& positions) {
  const auto pixels = picture.pixels();
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if (positions.pixels()[i] == kNoSource) pixels[i] = {0, 0, 0, 255};
  }
}

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

PixelPoints pixel_points(const WallScreen& screen, const glm::dvec3& eye) {
  PixelPoints points;
  points.map = screen.warp.points;
  points.eye = eye;
  points.axes = screen_axes(screen);
  return points;
}

View flat_view(const View& view, Size pixels) {
  HPR_CHECK(view.points && pixels.area() > 0);
  const PixelPoints& points = *view.points;
  ViewBounds seen;
  for (const PositionMap::Block& block : points.map->blocks()) {
    if (add_box(points, block.box, seen)) continue;
    points.map->visit(block, [&](const glm::dvec3& point) {
      if (const auto position = points.seen(point)) seen.add(*position);
    });
  }
  View flat = flattened(view, view);
  flat.screen = pixels;
  flat.block = {0, 0, pixels.width, pixels.height};
  if (!(seen.low.x < seen.high.x) || !(seen.low.y < seen.high.y)) return flat;
  flat.left = seen.low.x;
  flat.right = seen.high.x;
  flat.bottom = seen.low.y;
  flat.top = seen.high.y;
  return flat;
}

Size flat_pixels(const View& view) {
  constexpr int kLooks = 32;
  const PixelPoints& points = *view.points;
  const View flat = flat_view(view, view.screen);
  glm::dvec2 least(kInfinity);  // that a pixel covers, along the picture's axes
  for (int y = 0; y < kLooks; ++y) {
    for (int x = 0; x < kLooks; ++x) {
      const double s = (x + 0.5) / kLooks;
      const double t = (y + 0.5) / kLooks;
      const auto here = points.seen_at(s, t);
      const auto beside = points.seen_at(s + 1.0 / view.screen.width, t);
      const auto below = points.seen_at(s, t + 1.0 / view.screen.height);
      if (!here || !beside || !below) continue;
      least = glm::min(least, glm::max(glm::abs(*beside - *here), glm::abs(*below - *here)));
    }
  }
  const int most = std::min(2 * std::max(view.screen.width, view.screen.height), kMaxSourceSide);
  const auto pixels = [&](double extent, double step, int own) {
    const double wanted = extent / step;
    return std::isfinite(step) && std::isfinite(wanted)
               ? static_cast<int>(std::clamp(std::round(wanted), 1.0, static_cast<double>(most)))
               : own;
  };
  return {pixels(flat.right - flat.left, least.x, view.screen.width),
          pixels(flat.top - flat.bottom, least.y, view.screen.height)};
}

Image<SourcePosition> curved_sources(const View& view, const View& flat, int threads) {
  const PixelPoints& points = *view.points;
  Image<SourcePosition> sources(view.screen, kNoSource);
  const glm::dvec2 scale(flat.screen.width / (flat.right - flat.left), flat.screen.height / (flat.top - flat.bottom));
  parallel_for(threads, static_cast<std::size_t>(view.screen.height), [&](std::size_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < view.screen.width; ++x) {
      const auto position = points.seen_at((x + 0.5) / view.screen.width, (y + 0.5) / view.screen.height);
      if (!position) continue;
      sources.at(x, y) =
          source_position((position->x - flat.left) * scale.x, (flat.top - position->y) * scale.y, flat.screen);
    }
  });
  return sources;
}

CurvedScreens::CurvedScreens(std::span<const View> views, bool by_rays)
    : by_rays_(by_rays), cached_views_(views.size()) {
  for (const View& view : views) {
    sizes_.push_back(view.points && !by_rays ? flat_pixels(view) : view.screen);
  }
}

CurvedScreens::CachedView& CurvedScreens::cached_view(std::size_t picture, const View& view) {
  std::optional<CachedView>& seen = cached_views_[picture];
  const PixelPoints& points = *view.points;
  const auto as_before = [&](const PixelPoints& from) {
    return from.eye == points.eye && from.scale == points.scale && from.orthographic == points.orthographic;
  };
  if (!seen || !as_before(seen->from)) {
    seen = CachedView{points, by_rays_ ? view : flat_view(view, sizes_[picture]), {}};
  }
  return *seen;
}

std::vector<View> CurvedScreens::drawn(std::vector<View> views) {
  HPR_CHECK(views.size() == sizes_.size());
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (views[i].points && !by_rays_) views[i] = flattened(views[i], cached_view(i, views[i]).flat);
  }
  return views;
}

void CurvedScreens::finish(std::span<const View> views, std::vector<Image<Rgba8>>& pictures, int threads) {
  HPR_CHECK(views.size() == sizes_.size() && pictures.size() == sizes_.size());
  for (std::size_t i = 0; i < views.size(); ++i) {
    const View& view = views[i];
    if (!view.points || pictures[i].size().area() == 0) continue;
    CachedView& shown = cached_view(i, view);
    if (shown.positions.size() != view.screen) shown.positions = curved_sources(view, shown.flat, threads);
    if (by_rays_) {
      darken(pictures[i], shown.positions);
    } else {
      pictures[i] = warped(pictures[i], shown.positions, threads);
    }
  }
}

std::vector<WarpFigures> warp_figures(const Wall& wall) {
  std::vector<WarpFigures> all;
  for (std::size_t i = 0; i < wall.screens.size(); ++i) {
    const WallScreen& screen = wall.screens[i];
    if (!screen.warp.any()) continue;
    WarpFigures& figures = all.emplace_back();
    figures.screen = i;
    std::size_t lit = screen.pixels.area();
    if (screen.warp.grid) {
      const Image<SourcePosition> sources = mesh_sources(*screen.warp.grid, screen.pixels);
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
