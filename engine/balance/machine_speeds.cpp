#include "engine/balance/machine_speeds.h"

#include <fmt/format.h>

#include <algorithm>
#include <thread>
#include <vector>

#include "cluster/transport/collectives.h"
#include "compositing/model/cost_model.h"
#include "core/timing.h"
#include "engine/session.h"
#include "image/color.h"
#include "image/key.h"

namespace hpr {
namespace {

constexpr double kNsPerSecond = 1e9;
constexpr std::size_t kProbeTiles = 16;

/// What is measured, as one rank sends it to the others.
struct Measured {
  double triangle = 0.0;
  double pixel = 0.0;
  double read = 0.0;
  double draw = 0.0;
  double spread = 1.0;
};

/// Of the slowest rank.
RasterSpeed slowest_raster(Session& session, double crowding, double& spread) {
  RasterSpeed mine;
  agree_on_failure(session.comm(), [&] { mine = session.measure_raster(); });
  RasterSpeed slowest;
  for (const Measured& rank :
       all_gather_value(session.comm(), Measured{mine.triangle, mine.pixel, mine.read, mine.draw, mine.spread})) {
    slowest.triangle = std::max(slowest.triangle, crowding * rank.triangle);
    slowest.pixel = std::max(slowest.pixel, crowding * rank.pixel);
    slowest.read = std::max(slowest.read, crowding * rank.read);
    slowest.draw = std::max(slowest.draw, crowding * rank.draw);
    spread = std::max(spread, rank.spread);
  }
  return slowest;
}

}  // namespace

MachineSpeeds measure_speeds(Session& session, bool by_raster) {
  MachineSpeeds speeds;
  const double threads = session.threads();
  const double cores = std::max(1U, std::thread::hardware_concurrency());
  speeds.host_ranks = session.host_ranks();
  speeds.crowding = std::max(1.0, threads * speeds.host_ranks / cores);
  if (session.comm().models_time() || session.ranks() == 1) return speeds;
  for (double* const of_a_core : {&speeds.ray, &speeds.build, &speeds.light, &speeds.chunk, &speeds.finish}) {
    *of_a_core *= speeds.crowding / threads;
  }
  speeds.group *= speeds.crowding;
  const trace::Span span("measure speeds");
  if (by_raster) {
    double spread = 1.0;
    speeds.raster = slowest_raster(session, speeds.crowding, spread);
    // Ranks that crowd the cores interrupt each other by that much.
    if (spread > kMaxSpread * speeds.crowding) {
      speeds.noise = fmt::format("repetitions took {:.1f} times the least one", spread);
    }
  }
  const Costs costs = measure_costs(session.comm(), kProbeTiles);
  speeds.merge = kNsPerSecond * sizeof(Key) * costs.swap_byte;
  speeds.message = kNsPerSecond * costs.message;
  speeds.collect = kNsPerSecond * sizeof(Rgba8) * costs.collect_byte;
  // Costs count a byte of all ranks together.
  speeds.merge_in_place =
      costs.hosts == 1 && costs.read_byte ? kNsPerSecond * sizeof(Key) * *costs.read_byte * costs.ranks : speeds.merge;
  return speeds;
}

}  // namespace hpr
