#pragma once

#include <string>

#include "cluster/distribution/view_groups.h"
#include "raster/raster_speed.h"

namespace hpr {

class Session;

/// How fast ranks work while all of them do, in nanoseconds of a rank's time.
struct MachineSpeeds {
  RasterSpeed raster{.triangle = 100.0, .pixel = 1.5, .read = 0.6, .draw = 3e4};
  double ray = 100.0;           ///< that makes a key
  double build = 350.0;         ///< a triangle of Embree's scene
  double light = 300.0;         ///< a visible pixel
  double merge = 8.0;           ///< a pixel sent to another rank and merged there
  double merge_in_place = 8.0;  ///< a pixel merged in memory that ranks share
  double message = 2e4;         ///< a small message in flight
  double post = 2e3;            ///< a message more of many at once
  double chunk = 150.0;         ///< a chunk bounded
  double group = 35.0;          ///< a chunk grouped, where the view has moved a little
  double finish = 40.0;         ///< a pixel summed up, exposed and made a screen's, by who lit it
  double collect = 4.0;         ///< a pixel brought to the screen of another rank
  double crowding = 1.0;        ///< threads of all ranks by cores, at least 1: a rank that is alone is so much faster
  int host_ranks = 1;           ///< ranks of a host, which light tiles of each other
  std::string noise = {};       ///< why predictions by them are rough; empty where they are not

  [[nodiscard]] DrawSpeeds draw_speeds() const {
    return {.triangle = raster.triangle, .pixel = raster.pixel + raster.read, .merge = merge, .light = light};
  }
};

/// Collective. What this machine's ranks do of it as they are: OpenGL's speed, where `by_raster` and it runs, and what
/// messages and merging take; the least of several repetitions. The rest is as above, of a core, by the cores that a
/// rank has. Where repetitions lie apart by more than kMaxSpread, `noise` says so. The same on all ranks; about a tenth
/// of a second on a CPU. Throws Error on all ranks where one cannot draw.
[[nodiscard]] MachineSpeeds measure_speeds(Session& session, bool by_raster);

/// The median of repetitions by the least of them, on a machine of which nothing else wants the cores: past this,
/// frames take what else runs makes of them.
inline constexpr double kMaxSpread = 1.5;

}  // namespace hpr
