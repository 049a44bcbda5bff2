#include "engine/output.h"

#include <sys/resource.h>

#include <algorithm>
#include <cmath>

#include "cluster/transport/collectives.h"
#include "core/log.h"
#include "core/parallel.h"

namespace hpr {
namespace {

std::uint64_t peak_memory_bytes() {
  struct rusage usage {};
  ::getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
}

/// The slowest rank's time.
double slowest(Communicator& comm, double ms) {
  return std::ranges::max(all_gather_value(comm, ms));
}

}  // namespace

Blocks cut_blocks(std::span<const View> screens) {
  Blocks blocks;
  for (std::size_t screen = 0; screen < screens.size(); ++screen) {
    for (const View& block : split_into_blocks(screens[screen], kRasterLimit)) {
      blocks.views.push_back(block);
      blocks.screen_of.push_back(screen);
    }
  }
  return blocks;
}

std::vector<int> block_owners(const Blocks& blocks, std::span<const int> shown_by) {
  std::vector<int> owners;
  for (const std::size_t screen : blocks.screen_of) owners.push_back(shown_by[screen]);
  return owners;
}

namespace {

void to_display(std::span<const Rgb> radiance, std::span<Rgba8> display, double exposure_stops) {
  const auto gain = static_cast<float>(std::exp2(exposure_stops));
  std::ranges::transform(radiance, display.begin(), [gain](const Rgb& color) {
    return to_srgb({color.r * gain, color.g * gain, color.b * gain});
  });
}

}  // namespace

Image<Rgba8> to_display(const Image<Rgb>& radiance, int threads, double exposure_stops) {
  Image<Rgba8> display(radiance.size());
  parallel_for(threads, static_cast<std::size_t>(radiance.height()), [&](std::size_t row) {
    const int y = static_cast<int>(row);
    to_display(radiance.row(y), display.row(y), exposure_stops);
  });
  return display;
}

TileLayer<Rgba8> to_display(const Frame& frame, int threads, double exposure_stops) {
  TileLayer<Rgba8> display(frame.radiance.layout());
  for (const std::size_t tile : frame.owned) display.set_active(tile);
  parallel_for(threads, frame.owned.size(), [&](std::size_t i) {
    to_display(frame.radiance.tile(frame.owned[i]), display.tile(frame.owned[i]), exposure_stops);
  });
  return display;
}

RunStats gather_stats(Session& session, const FramePlan& plan, const FrameTimes& times, const FrameCost& cost) {
  CountingCommunicator& comm = session.comm();
  RunStats stats;
  stats.ranks = comm.size();
  stats.plan = plan.explained;
  stats.passes = plan_passes(session.requirements(), plan.rays);
  stats.ms = slowest(comm, cost.ms);
  stats.times.push_back({plan.primary == Primary::Rays ? "primary-rays" : "raster", slowest(comm, times.primary_ms)});
  for (const PrimaryRayStats& traced : all_gather_value(comm, times.primary)) {
    stats.rays.primary += traced.rays;
    stats.rays.invalid += traced.invalid;
  }
  stats.times.push_back({"composite", slowest(comm, times.composite_ms)});
  // The shader adds up what its threads took; a frame waits for them side by side.
  for (const PassTime& pass : times.passes) {
    stats.times.push_back({pass.name, slowest(comm, pass.ms / session.threads()), pass.pass});
  }
  for (const RayCounts& counts : all_gather_value(comm, times.rays)) stats.rays += counts;
  if (stats.rays.not_finite > 0 && comm.rank() == 0) {
    const ScreenPixel& first = stats.rays.first_not_finite;
    log::warning("{} samples of pixels had no finite radiance and are black, the first in pixel {},{} of screen {}",
                 stats.rays.not_finite, first.x, first.y, first.screen);
  }
  stats.samples = times.samples;
  stats.samples_in_all = times.samples;
  for (const std::size_t sent : all_gather_value(comm, cost.bytes_sent)) stats.bytes_sent += sent;
  stats.memory_peak_bytes = all_gather_value(comm, peak_memory_bytes());
  return stats;
}

}  // namespace hpr
