#include "engine/primary_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>

#include "cluster/transport/collectives.h"
#include "core/log.h"
#include "core/timing.h"

namespace hpr {
namespace {

/// A prime, so that the tiles looked at do not stand in columns.
constexpr std::size_t kEachTile = 7;

double quickest_ms(TileLayer<Key>& keys, const std::function<void()>& draw) {
  double best = 0.0;
  for (int attempt = 0; attempt < 2; ++attempt) {
    keys.clear();
    const Stopwatch watch;
    draw();
    best = attempt == 0 ? watch.ms() : std::min(best, watch.ms());
  }
  return best;
}

/// The plan with every seventh tile of its area; `share` is set to how much of the area that is.
FramePlan sampled(const FramePlan& plan, double& share) {
  FramePlan some = plan;
  some.mine.area.clear();
  std::size_t all_pixels = 0;
  std::size_t some_pixels = 0;
  std::size_t seen = 0;
  for (const ScreenRect& rect : plan.mine.area) {
    all_pixels += rect.pixels.area();
    for (int y = rect.pixels.y0; y < rect.pixels.y1; y += kTileSide) {
      for (int x = rect.pixels.x0; x < rect.pixels.x1; x += kTileSide) {
        if (seen++ % kEachTile != 0) continue;
        const Rect tile = intersection(rect.pixels, {x, y, x + kTileSide, y + kTileSide});
        some.mine.area.push_back({rect.screen, tile});
        some_pixels += tile.area();
      }
    }
  }
  share = some_pixels > 0 ? static_cast<double>(some_pixels) / static_cast<double>(all_pixels) : 1.0;
  return some;
}

struct KeyTimes {
  double raster_ms = 0.0;
  double rays_ms = 0.0;
};

}  // namespace

std::string choose_primary(Session& session, FramePlan& plan, std::span<const View> views) {
  KeyTimes mine;
  if (!plan.mine.area.empty()) {
    double share = 1.0;
    const FramePlan some = sampled(plan, share);
    TileLayer<Key> keys(plan.layout);
    mine.raster_ms = quickest_ms(keys, [&] { rasterize(session, plan, views, keys); });
    (void)session.primary_rays(plan.mine.objects, plan.rays);
    const JitteredViews look{{views.begin(), views.end()}, {}};
    TileLayer<Key>* const layer = &keys;
    const auto trace = [&] { (void)trace_primary(session, some, std::span(&look, 1), std::span(&layer, 1)); };
    mine.rays_ms = quickest_ms(keys, trace) / share;
  }
  KeyTimes worst;
  for (const KeyTimes& times : all_gather_value(session.comm(), mine)) {
    worst.raster_ms = std::max(worst.raster_ms, times.raster_ms);
    worst.rays_ms = std::max(worst.rays_ms, times.rays_ms);
  }
  plan.primary = worst.rays_ms < worst.raster_ms ? Primary::Rays : Primary::Raster;
  std::string why = fmt::format("measured: {:.1f} ms by rays, {:.1f} ms by OpenGL", worst.rays_ms, worst.raster_ms);
  if (session.comm().rank() == 0) log::info("primary: {} ({})", plan.primary == Primary::Rays ? "rays" : "raster", why);
  return why;
}

}  // namespace hpr
