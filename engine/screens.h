#pragma once

#include <span>
#include <vector>

#include "engine/frame.h"
#include "engine/output.h"

namespace hpr {

/// Where a frame is shown.
struct Showing {
  std::vector<Size> sizes;    ///< per screen, pixels; a frame made of fewer or more is enlarged by a filter
  std::vector<int> shown_by;  ///< per screen the rank
  double exposure_stops = 0.0;
};

/// Collective. Brings the frame, which was made in `blocks`, to the ranks that show it. Per screen its display colours,
/// empty where another rank shows it.
[[nodiscard]] std::vector<Image<Rgba8>> bring_to_screens(Session& session, Frame& frame, const Blocks& blocks,
                                                         const Showing& showing);

}  // namespace hpr
