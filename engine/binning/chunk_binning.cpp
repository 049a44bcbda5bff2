#include "engine/binning/chunk_binning.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "cluster/transport/collectives.h"
#include "core/timing.h"
#include "engine/frame.h"
#include "engine/plan.h"
#include "engine/session.h"
#include "raster/chunk_triangles.h"
#include "raster/rasterizer.h"

namespace hpr {

bool bins_chunks(const Session& session, const FramePlan& plan) {
  return plan.distribution == Distribution::SortMiddle && session.ranks() > 1;
}

namespace {

/// Per rank and screen, of `chunks` those that may be seen in the rank's area.
std::vector<ScreenChunks> bin_for_all(const FramePlan& plan, const Rasterizer& rasterizer, const ChunkRange& chunks,
                                      std::span<const View> views, FrameTimes& spent) {
  const Stopwatch watch;
  std::vector<ScreenChunks> found(plan.areas.size(), ScreenChunks(views.size()));
  for (std::size_t screen = 0; screen < views.size(); ++screen) {
    std::vector<std::vector<Rect>> areas;
    for (const std::vector<ScreenRect>& area : plan.areas) areas.push_back(parts_of(area, screen));
    ChunkBins bins = rasterizer.bin(views[screen], chunks, areas);
    for (std::size_t owner = 0; owner < areas.size(); ++owner) found[owner][screen] = std::move(bins.areas[owner]);
    spent.raster.chunks_culled += bins.chunks_culled;
  }
  spent.raster.cull_ms += watch.ms();
  return found;
}

/// What is found on any screen, each chunk once.
std::vector<ChunkRange> united(const ScreenChunks& found) {
  std::vector<ChunkRange> all;
  for (const std::vector<ChunkRange>& ranges : found) all.insert(all.end(), ranges.begin(), ranges.end());
  std::ranges::sort(all, {}, &ChunkRange::first);
  std::vector<ChunkRange> ranges;
  std::uint32_t end = 0;
  for (const ChunkRange& range : all) {
    if (range.last <= end) continue;
    append_range(ranges, {std::max(range.first, end), range.last});
    end = range.last;
  }
  return ranges;
}

}  // namespace

ScreenChunks find_chunks(Session& session, const FramePlan& plan, const Rasterizer& rasterizer,
                         std::span<const View> views, FrameTimes& spent) {
  const trace::Span span("bin chunks");
  const ChunkRange part = part_of_chunks(rasterizer.chunks().last, session.rank(), session.ranks());
  const std::vector<ScreenChunks> found = bin_for_all(plan, rasterizer, part, views, spent);
  const Stopwatch watch;
  ScreenChunks mine = exchange_chunks(session.comm(), found);
  spent.chunk_exchange_ms += watch.ms();
  return mine;
}

Rasterizer& receive_triangles(Session& session, const FramePlan& plan, const Rasterizer& rasterizer,
                              std::span<const View> views, FrameTimes& spent) {
  const trace::Span span("send triangles");
  std::vector<std::vector<std::byte>> messages;
  for (const ScreenChunks& found : bin_for_all(plan, rasterizer, rasterizer.chunks(), views, spent)) {
    messages.push_back(rasterizer.pack(united(found)));
  }
  const Stopwatch watch;
  const std::vector<std::vector<std::byte>> received = all_to_all(session.comm(), std::move(messages));
  spent.chunk_exchange_ms += watch.ms();
  Rasterizer& receiving = session.receiving_rasterizer();
  receiving.load(unpack_triangles(session.scene(), received));
  return receiving;
}

std::string explain_binning(const FramePlan& plan, int ranks) {
  if (ranks == 1) return "bin: off (one rank has nobody to cull for)";
  if (plan.primary == Primary::Rays) {
    return "bin: off (primary rays cull nothing that ranks could share: as sort-first)";
  }
  if (plan.rays.part) return "bin: each rank culls its own objects for all tiles, and sends their owners the triangles";
  return fmt::format("bin: each rank culls 1/{} of the chunks for all tiles, and their owners draw what was found",
                     ranks);
}

}  // namespace hpr
