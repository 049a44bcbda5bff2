#include "walls/geometry/monitors.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "image/image.h"
#include "walls/drawing/assemble.h"
#include "walls/geometry/geometry.h"

namespace hpr {
namespace {

/// The surface alone.
Wall surface_of(const Wall& wall, const std::string& surface, std::vector<std::size_t>& indices) {
  const auto on_it = [&](const WallScreen& screen) { return screen.surface == surface; };
  const bool any_other = std::ranges::any_of(
      wall.screens, [&](const WallScreen& screen) { return on_it(screen) && screen.eye != Eye::Right; });
  Wall part = wall;
  part.screens.clear();
  for (std::size_t i = 0; i < wall.screens.size(); ++i) {
    const WallScreen& screen = wall.screens[i];
    if (!on_it(screen) || (any_other && screen.eye == Eye::Right)) continue;
    part.screens.push_back(screen);
    indices.push_back(i);
  }
  return part;
}

}  // namespace

MonitorLayout monitor_layout(const Wall& wall, const WallMonitor& monitor) {
  // Finer than any monitor, so that scaling its whole pixels rounds to the right ones.
  constexpr int kFine = 1 << 24;
  MonitorLayout layout;
  const Wall part = surface_of(wall, monitor.surface, layout.screens);
  HPR_CHECK(!part.screens.empty());
  const WallPicture picture = wall_picture(part, kFine);
  const double scale = std::min(static_cast<double>(monitor.pixels.width) / picture.size.width,
                                static_cast<double>(monitor.pixels.height) / picture.size.height);
  const double left = 0.5 * (monitor.pixels.width - scale * picture.size.width);
  const double top = 0.5 * (monitor.pixels.height - scale * picture.size.height);
  const auto place = [&](const Rect& rect) {
    const auto edge = [](double at, int most) { return std::clamp(static_cast<int>(std::lround(at)), 0, most); };
    Rect result;
    result.x0 = edge(left + scale * rect.x0, monitor.pixels.width - 1);
    result.y0 = edge(top + scale * rect.y0, monitor.pixels.height - 1);
    result.x1 = std::max(result.x0 + 1, edge(left + scale * rect.x1, monitor.pixels.width));
    result.y1 = std::max(result.y0 + 1, edge(top + scale * rect.y1, monitor.pixels.height));
    return result;
  };
  layout.surface = place({0, 0, picture.size.width, picture.size.height});
  std::ranges::transform(picture.screens, std::back_inserter(layout.places), place);
  return layout;
}

Image<Rgba8> draw_monitor(const Wall& wall, const WallMonitor& monitor, const MonitorLayout& layout,
                          std::span<const Image<Rgba8>> pictures) {
  HPR_CHECK(pictures.size() == layout.places.size());
  Image<Rgba8> result(monitor.pixels, {0, 0, 0, 255});
  const Rect& surface = layout.surface;
  paste(Image<Rgba8>({surface.width(), surface.height()}, wall.gap_color), surface.x0, surface.y0, result);
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const Rect& place = layout.places[i];
    if (pictures[i].size().area() == 0) continue;
    paste(resample(pictures[i], {place.width(), place.height()}), place.x0, place.y0, result);
  }
  return result;
}

}  // namespace hpr
