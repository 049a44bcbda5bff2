#pragma once

#include <span>
#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "walls/config/wall.h"

namespace hpr {

/// Where a surface's screens lie on an operator's monitor: as large as it fits, in the middle, with its gaps.
struct MonitorLayout {
  Rect surface;                      ///< all of it, gaps included
  std::vector<std::size_t> screens;  ///< indices into Wall::screens; of two for different eyes in one place, the left
  std::vector<Rect> places;          ///< one each, none empty
};

[[nodiscard]] MonitorLayout monitor_layout(const Wall& wall, const WallMonitor& monitor);

/// The monitor's picture: `pictures`, one per screen of the layout, each resampled to its place where it has not that
/// size; gaps in the wall's gap colour, black around the surface.
[[nodiscard]] Image<Rgba8> draw_monitor(const Wall& wall, const WallMonitor& monitor, const MonitorLayout& layout,
                                        std::span<const Image<Rgba8>> pictures);

}  // namespace hpr
