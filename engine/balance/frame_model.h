#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "cluster/distribution/assignment.h"
#include "cluster/distribution/view_groups.h"
#include "engine/balance/machine_speeds.h"
#include "image/tiles.h"

namespace hpr {

class Session;
struct View;

/// What a frame has to draw, however it is shared out.
struct FrameLoad {
  FrameLayout layout;
  std::vector<ScreenChunk> chunks;    ///< that are in view
  std::vector<ObjectChunk> objects;   ///< all that there are
  std::vector<double> light_ns;       ///< per tile; empty: what is in view, by MachineSpeeds::light
  bool by_rays = false;               ///< whether rays make the keys
  std::uint64_t built_triangles = 0;  ///< of the Embree scene that rays need for keys alone
  int writers = 1;                    ///< ranks that show screens
  double frames = 8.0;                ///< among which what is done once is shared out
};

/// What a view of the session's scene has to draw. `light_ns` and what rays need are left to the caller.
[[nodiscard]] FrameLoad load_of(Session& session, std::span<const View> views);

/// What a frame is expected to take.
struct FramePrediction {
  Distribution distribution = Distribution::SortFirst;
  double draw_ms = 0.0;       ///< keys, of the slowest rank
  double composite_ms = 0.0;  ///< sending and merging them
  double light_ms = 0.0;
  double prepare_ms = 0.0;  ///< a frame's part of what is done once, and grouping
  double show_ms = 0.0;     ///< sums, exposure, tiles to screens
  double imbalance = 1.0;   ///< of drawing and light, the slowest rank by the mean
  double overlap = 1.0;     ///< ranks that draw into a tile, of tiles that any draws into
  double drawn_ns = 0.0;    ///< by all ranks together, light included

  [[nodiscard]] double total_ms() const { return draw_ms + composite_ms + light_ms + prepare_ms + show_ms; }
};

/// The phases that a frame's time is the sum of, with their names for people.
struct FramePhase {
  const char* name;
  double FramePrediction::*ms;
};
inline constexpr std::array kFramePhases{
    FramePhase{"drawing", &FramePrediction::draw_ms}, FramePhase{"compositing", &FramePrediction::composite_ms},
    FramePhase{"light", &FramePrediction::light_ms}, FramePhase{"grouping and building", &FramePrediction::prepare_ms},
    FramePhase{"tiles to screens", &FramePrediction::show_ms}};

/// Predicts a frame by so many ranks, which may be more than there are. `groups`: of Hybrid; 0: by view where OpenGL
/// draws, else default_groups(). Every rank has one part in each phase, and the slowest one's is what the phase takes.
/// Milliseconds for a few ranks, about a second for a thousand.
[[nodiscard]] FramePrediction predict_frame(Distribution distribution, const FrameLoad& load,
                                            const MachineSpeeds& speeds, int ranks, int groups = 0);

/// How much of `ranks` times one rank's speed a frame has.
[[nodiscard]] double efficiency(const FramePrediction& one_rank, const FramePrediction& prediction, int ranks);

/// The phase in which a frame by `ranks` loses most against its part of what it takes one rank, and how much of the
/// frame that is.
struct FrameLimit {
  const FramePhase* phase = nullptr;
  double part = 0.0;
};
[[nodiscard]] FrameLimit limit_of(const FramePrediction& one_rank, const FramePrediction& prediction, int ranks);

}  // namespace hpr
