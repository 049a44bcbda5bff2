#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "cluster/distribution/assignment.h"
#include "cluster/distribution/view_groups.h"
#include "image/tiles.h"
#include "raster/raster_speed.h"

namespace hpr {

class Session;
struct View;

/// How fast ranks work while all of them do, in nanoseconds of a rank's time.
struct MachineSpeeds {
  RasterSpeed raster{.triangle = 100.0, .pixel = 1.5, .read = 0.6, .draw = 3e4};
  double ray = 100.0;     ///< that makes a key
  double build = 350.0;   ///< a triangle of Embree's scene
  double light = 300.0;   ///< a visible pixel
  double merge = 8.0;     ///< a pixel sent to another rank and merged there
  double message = 2e4;   ///< a small message in flight
  double post = 2e3;      ///< a message more of many at once
  double chunk = 150.0;   ///< a chunk bounded
  double group = 35.0;    ///< a chunk grouped, where the view has moved a little
  double crowding = 1.0;  ///< threads of all ranks by cores, at least 1: a rank that is alone is so much faster
  int host_ranks = 1;     ///< ranks of a host, which light tiles of each other

  [[nodiscard]] DrawSpeeds draw_speeds() const {
    return {.triangle = raster.triangle, .pixel = raster.pixel + raster.read, .merge = merge, .light = light};
  }
};

/// What a frame has to draw, however it is shared out.
struct FrameLoad {
  FrameLayout layout;
  std::vector<ScreenChunk> chunks;    ///< that are in view
  std::vector<ObjectChunk> objects;   ///< all that there are
  std::vector<double> light_ns;       ///< per tile; empty: what is in view, by MachineSpeeds::light
  bool by_rays = false;               ///< whether rays make the keys
  std::uint64_t built_triangles = 0;  ///< of the Embree scene that rays need for keys alone
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
  double imbalance = 1.0;   ///< of drawing and light, the slowest rank by the mean
  double overlap = 1.0;     ///< ranks that draw into a tile, of tiles that any draws into
  double drawn_ns = 0.0;    ///< by all ranks together, light included

  [[nodiscard]] double total_ms() const { return draw_ms + composite_ms + light_ms + prepare_ms; }
};

/// Predicts a frame by so many ranks, which may be more than there are. `groups`: of Hybrid; 0: by view where OpenGL
/// draws, else default_groups(). Every rank has one part in each phase, and the slowest one's is what the phase takes.
/// Milliseconds for a few ranks, about a second for a thousand.
[[nodiscard]] FramePrediction predict_frame(Distribution distribution, const FrameLoad& load,
                                            const MachineSpeeds& speeds, int ranks, int groups = 0);

/// How much of `ranks` times one rank's speed a frame has.
[[nodiscard]] double efficiency(const FramePrediction& one_rank, const FramePrediction& prediction, int ranks);

}  // namespace hpr
