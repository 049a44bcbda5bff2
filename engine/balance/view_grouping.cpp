#include "engine/balance/view_grouping.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "cluster/distribution/balance.h"
#include "cluster/transport/collectives.h"
#include "core/timing.h"
#include "engine/session.h"
#include "raster/chunk_bounds.h"

namespace hpr {
namespace {

/// Whether keys of both lie at the same pixels, but for the jitter.
bool same_but_jitter(const View& a, const View& b) {
  return a.eye == b.eye && a.axes == b.axes && a.left == b.left && a.right == b.right && a.top == b.top &&
         a.bottom == b.bottom && a.near_distance == b.near_distance && a.far_distance == b.far_distance &&
         a.orthographic == b.orthographic && a.screen == b.screen && a.block == b.block;
}

bool is_slight(const glm::dvec2& jitter) {
  return std::abs(jitter.x) <= kMaxJitter && std::abs(jitter.y) <= kMaxJitter;
}

/// Adds what a view shows of a cluster; joins it with what there is of the same one.
void add_chunk(const ScreenChunk& chunk, std::vector<ScreenChunk>& chunks) {
  if (chunks.empty() || chunks.back().screen != chunk.screen || chunks.back().surfaces != chunk.surfaces) {
    chunks.push_back(chunk);
    return;
  }
  Rect& all = chunks.back().pixels;
  const Rect& part = chunk.pixels;
  all = {std::min(all.x0, part.x0), std::min(all.y0, part.y0), std::max(all.x1, part.x1), std::max(all.y1, part.y1)};
  chunks.back().covered += chunk.covered;
}

}  // namespace

std::vector<ScreenChunk> chunks_on_screens(Session& session, std::span<const View> views) {
  const trace::Span span("bound chunks");
  const SceneChunks& scene = session.scene_chunks();
  const auto ranks = static_cast<std::size_t>(session.ranks());
  const auto rank = static_cast<std::size_t>(session.rank());
  // A message costs more than to bound a few.
  constexpr std::size_t kFewChunks = 1024;
  const bool divides = ranks > 1 && scene.chunks.size() > kFewChunks;
  const std::size_t first = divides ? scene.chunks.size() * rank / ranks : 0;
  const std::size_t last = divides ? scene.chunks.size() * (rank + 1) / ranks : scene.chunks.size();
  std::vector<ScreenChunk> mine;
  for (std::size_t screen = 0; screen < views.size(); ++screen) {
    const std::span<const SceneChunk> chunks = std::span(scene.chunks).subspan(first, last - first);
    for (const ChunkBounds& bounds : bound_chunks(session.scene(), chunks, views[screen], session.threads())) {
      add_chunk({scene.clusters[chunks[bounds.chunk].cluster], static_cast<std::uint32_t>(screen), bounds.pixels,
                 bounds.covered},
                mine);
    }
  }
  if (!divides) return mine;
  const auto all = all_gather_lists(session.comm(), std::span<const ScreenChunk>(mine));
  std::vector<std::size_t> next(all.size(), 0);
  std::vector<ScreenChunk> on_screens;
  for (std::size_t screen = 0; screen < views.size(); ++screen) {
    for (std::size_t from = 0; from < all.size(); ++from) {
      for (; next[from] < all[from].size() && all[from][next[from]].screen == screen; ++next[from]) {
        add_chunk(all[from][next[from]], on_screens);  // a cluster may lie on two ranks
      }
    }
  }
  return on_screens;
}

ViewGrouping::ViewGrouping(Session& session, const FrameLayout& layout, std::span<const View> views,
                           const DrawSpeeds& speeds, std::span<const double> light_costs)
    : views_(views.begin(), views.end()), chunks_(chunks_on_screens(session, views)) {
  groups_ = group_by_view(layout, chunks_, session.ranks(), speeds, light_costs);
  select(session, layout);
}

void ViewGrouping::follow(Session& session, const FrameLayout& layout, std::span<const View> views,
                          const DrawSpeeds& speeds, std::span<const double> light_costs) {
  if (fits(views)) return;
  std::vector<ScreenChunk> chunks = chunks_on_screens(session, views);
  groups_ = follow_view(groups_, chunks_, layout, chunks, speeds, light_costs);
  chunks_ = std::move(chunks);
  views_.assign(views.begin(), views.end());
  select(session, layout);
}

bool ViewGrouping::fits(std::span<const View> views) const {
  return std::ranges::equal(views, views_, same_but_jitter) &&
         std::ranges::all_of(views, [](const View& view) { return is_slight(view.jitter); });
}

void ViewGrouping::select(Session& session, const FrameLayout& layout) {
  surfaces_.clear();
  for (std::size_t screen = 0; screen < layout.screens(); ++screen) {
    surfaces_.push_back(drawn_surfaces(groups_, chunks_, session.rank(), screen));
  }
}

std::string describe(const ViewGrouping& grouping) {
  return fmt::format("{} chunks, {:.2f} ranks draw a pixel, the slowest rank draws {:.2f} of the mean",
                     grouping.chunks().size(), grouping.groups().overlap, slowest_over_mean(grouping.groups().draw_ns));
}

}  // namespace hpr
