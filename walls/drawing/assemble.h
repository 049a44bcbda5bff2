#pragma once

#include <span>
#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "walls/config/wall.h"
#include "walls/geometry/geometry.h"

namespace hpr {

/// The assembled wall: each screen's picture (upright, in the wall's order) at its place, and the wall's gap colour
/// between them. A picture whose size differs from its place is resampled by area, in linear light; an empty one
/// leaves its place black. Of two screens for different eyes in one place the left eye's is seen.
[[nodiscard]] Image<Rgba8> draw_wall(const Wall& wall, const WallPicture& picture,
                                     std::span<const Image<Rgba8>> screens);
/// The assembled wall of pictures that need not be there: a null one leaves its place black.
[[nodiscard]] Image<Rgba8> draw_wall(const Wall& wall, const WallPicture& picture,
                                     std::span<const Image<Rgba8>* const> screens);

/// `image` on `size` pixels: each the mean, in linear light, of the area it covers; where alpha differs, of the colours
/// as far as they cover.
[[nodiscard]] Image<Rgba8> resample(const Image<Rgba8>& image, Size size);

/// What is seen of `image` in front of black, in linear light: with alpha 255.
[[nodiscard]] Image<Rgba8> over_black(Image<Rgba8> image);

/// `image` turned clockwise by 0, 90, 180 or 270 degrees: what is sent to a panel that is mounted turned.
[[nodiscard]] Image<Rgba8> turn_clockwise(const Image<Rgba8>& image, int degrees);

/// Where a surface's screens lie on an operator's monitor: as large as it fits, in the middle, with its gaps.
struct MonitorLayout {
  Rect surface;                      ///< all of it, gaps included
  std::vector<std::size_t> screens;  ///< indices into Wall::screens; of two for different eyes in one place, the left
  std::vector<Rect> rects;           ///< one each, none empty
};

[[nodiscard]] MonitorLayout monitor_layout(const Wall& wall, const WallMonitor& monitor);

/// The monitor's picture: `pictures`, one per screen of the layout, each resampled to its place where it has not that
/// size, before black; gaps in the wall's gap colour, black around the surface.
[[nodiscard]] Image<Rgba8> draw_monitor(const Wall& wall, const WallMonitor& monitor, const MonitorLayout& layout,
                                        std::span<const Image<Rgba8>> pictures);

}  // namespace hpr
