#include "engine/binning/chunk_binning.h"

#include <fmt/format.h>

#include <utility>
#include <vector>

#include "core/timing.h"
#include "engine/frame.h"
#include "engine/plan.h"
#include "engine/session.h"
#include "raster/rasterizer.h"

namespace hpr {

bool bins_chunks(const Session& session, const FramePlan& plan) {
  return plan.distribution == Distribution::SortMiddle && session.ranks() > 1;
}

ScreenChunks find_chunks(Session& session, const FramePlan& plan, const Rasterizer& rasterizer,
                         std::span<const View> views, FrameTimes& spent) {
  const trace::Span span("bin chunks");
  Stopwatch watch;
  const ChunkRange part = part_of_chunks(rasterizer.chunks().last, session.rank(), session.ranks());
  std::vector<ScreenChunks> found(plan.areas.size(), ScreenChunks(views.size()));
  for (std::size_t screen = 0; screen < views.size(); ++screen) {
    std::vector<std::vector<Rect>> areas;
    for (const std::vector<ScreenRect>& area : plan.areas) areas.push_back(parts_of(area, screen));
    ChunkBins bins = rasterizer.bin(views[screen], part, areas);
    for (std::size_t owner = 0; owner < areas.size(); ++owner) found[owner][screen] = std::move(bins.areas[owner]);
    spent.raster.chunks_culled += bins.chunks_culled;
  }
  spent.raster.cull_ms += watch.ms();
  watch.restart();
  ScreenChunks mine = exchange_chunks(session.comm(), found);
  spent.chunk_exchange_ms += watch.ms();
  return mine;
}

std::string explain_binning(const FramePlan& plan, int ranks) {
  if (ranks == 1) return "bin: off (one rank has nobody to cull for)";
  if (plan.primary == Primary::Rays) {
    return "bin: off (primary rays cull nothing that ranks could share: as sort-first)";
  }
  return fmt::format("bin: each rank culls 1/{} of the chunks for all tiles, and their owners draw what was found",
                     ranks);
}

}  // namespace hpr
