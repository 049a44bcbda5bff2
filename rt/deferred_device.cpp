#include <algorithm>
#include <glm/geometric.hpp>
#include <utility>

#include "core/timing.h"
#include "rt/deferred_state.h"
#include "rt/denoise/denoiser.h"

namespace hpr {
namespace {

/// At least so many tiles are lit together, and some for each thread.
constexpr std::size_t kFilteredTiles = 8;
constexpr std::size_t kFilteredTilesOfThread = 2;

/// A tile while a device makes the light that is filtered then.
struct FilteredTile {
  std::size_t index = 0;
  std::vector<TileJob> jobs;
  LightContext context;
  std::unique_ptr<TileScratch> scratch;
  const TileFragments* fragments = nullptr;
  std::vector<EyePoint> points = {};  ///< that the device is to light next
  std::vector<PointLight> light = {};

  void add_points(std::span<const PathVertex> found) {
    for (const PathVertex& point : found) {
      const SurfacePoint& surface = point.surface;
      const double metres = glm::distance(context.view->eye, surface.position);
      points.push_back({surface.position + metres * surface.to_viewer, -surface.to_viewer, point.coverage,
                        point.sampler.restarted(), surface.surface, point.pixel});
    }
  }

  void add_light() {
    PixelSums& sums = scratch->sums;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const std::uint32_t pixel = points[i].pixel;
      sums.radiance[pixel] += light[i].radiance;
      sums.diffuse[pixel] += light[i].diffuse;
      sums.distance[pixel] = std::min(sums.distance[pixel], light[i].distance);
      if (sums.wants_components) sums.components[static_cast<std::size_t>(Component::Direct)][pixel] += light[i].direct;
    }
    points.clear();
  }
};

}  // namespace

/// Some tiles whose samples are denoised, from what they show to what is stored.
struct DeferredShader::State::FilteredTiles {
  State& state;
  const Call& call;
  const TilesToShade& lit;
  RayCounts& traced;
  double& device_ms;
  std::vector<FilteredTile> tiles = {};
  std::vector<std::size_t> left = {};  ///< that the device could not finish

  void for_each(const std::function<void(FilteredTile&)>& body) {
    state.for_each(tiles.size(), [&](std::size_t i) {
      const DenormalsAsZero mode;
      body(tiles[i]);
    });
  }

  void shade(std::span<const std::size_t> indices) {
    for (const std::size_t index : indices) start(index);
    for_each([this](FilteredTile& tile) { find_points(tile); });
    light();
    const std::span<const ShadedSample> samples = lit.samples;
    for (std::size_t sample = 0; sample < samples.size() && state.denoises(samples[sample].number); ++sample) {
      for_each([&](FilteredTile& tile) { resample(tile, sample); });
      light();
      for_each([&](FilteredTile& tile) { resolve(tile, sample); });
    }
    for_each([this](FilteredTile& tile) { store(tile); });
    for (FilteredTile& tile : tiles) state.tile_memory.put_back(std::move(tile.scratch));
    tiles.clear();
  }

 private:
  void start(std::size_t index) {
    const ShadedSample& first = lit.samples.front();
    if (!wants_any(mask_of(first.wanted, index))) return;
    for (const ShadedSample& sample : lit.samples) set_active(sample.output, index);
    const std::size_t screen = first.keys->layout().place(index).screen;
    tiles.push_back({index, state.jobs_of(call, {.tile = index}), state.context_of(call, screen),
                     state.tile_memory.take(state.steps())});
  }

  void find_points(FilteredTile& tile) const {
    const TilePart part{tile.jobs, lit.samples, tile.index, true};
    TileScratch& scratch = *tile.scratch;
    state.start_tile(tile.context, scratch, part,
                     [&](const std::vector<PathVertex>& points) { tile.add_points(points); });
    std::vector<PathVertex> points;
    for (std::size_t sample = 0; sample < tile.jobs.size(); ++sample) {
      points.clear();
      const RowRange rows{0, tile.jobs[sample].end_row()};
      state.find_rows(tile.context, scratch, scratch.own, part, sample, rows, points);
      tile.add_points(points);
    }
  }

  /// Has the device light all points.
  void light() {
    const Stopwatch watch;
    std::vector<PointsOfView> groups;
    for (FilteredTile& tile : tiles) {
      tile.light.assign(tile.points.size(), PointLight{});
      if (!tile.points.empty()) groups.push_back({tile.context.view, tile.context.eye_media, tile.points, tile.light});
    }
    {
      const trace::Span span("light, on the device");
      state.device->shade_points({groups, lit.samples.front().number, lit.photons, lit.is_overtaken}, traced);
    }
    device_ms += watch.ms();
    leave_unfinished();
    for_each([](FilteredTile& tile) { tile.add_light(); });
  }

  void leave_unfinished() {
    std::vector<FilteredTile> finished;
    for (FilteredTile& tile : tiles) {
      if (std::ranges::all_of(tile.light, [](const PointLight& light) { return light.is_unfinished == 0; })) {
        finished.push_back(std::move(tile));
      } else {
        left.push_back(tile.index);
        state.tile_memory.put_back(std::move(tile.scratch));
      }
    }
    tiles.swap(finished);
  }

  void resample(FilteredTile& tile, std::size_t sample) const {
    const Stopwatch watch;
    TileScratch& scratch = *tile.scratch;
    if (sample == 0) {
      tile.fragments =
          &state.fragments.of_tile(tile.context, scratch.own.buffers, tile.jobs.front(), tile.index, scratch.finder);
    }
    scratch.denoiser.resample_edges(tile.context, tile.jobs[sample], margin_of(scratch, sample), *tile.fragments,
                                    scratch.own.buffers, scratch.sums, scratch.points);
    tile.add_points(scratch.points);
    scratch.points.clear();
    scratch.own.ms.back() += watch.ms();
  }

  static void resolve(const FilteredTile& tile, std::size_t sample) {
    const Stopwatch watch;
    TileScratch& scratch = *tile.scratch;
    scratch.denoiser.resolve(tile.context, tile.jobs[sample], *tile.fragments, scratch.sums);
    scratch.own.ms.back() += watch.ms();
  }

  void store(const FilteredTile& tile) const {
    TileScratch& scratch = *tile.scratch;
    for (std::size_t i = 0; i < tile.jobs.size(); ++i) {
      scratch.sums.store(tile.jobs[i], tile.index, lit.samples[i].output, scratch.own.buffers.counts);
    }
  }
};

std::vector<std::size_t> DeferredShader::State::light_by_device(const Call& call, const TilesToShade& lit,
                                                                RayCounts& traced, double& device_ms) {
  const ShadedSample& first = lit.samples.front();
  if (!device || !wants_light_alone(first.output)) return {lit.tiles.begin(), lit.tiles.end()};
  device->clear_times();
  if (denoises(first.number)) return light_filtered(call, lit, traced, device_ms);
  const Stopwatch watch;
  std::vector<std::size_t> left = shade_on_device(*device, lit, traced);
  device_ms += watch.ms();
  return left;
}

std::vector<std::size_t> DeferredShader::State::light_filtered(const Call& call, const TilesToShade& lit,
                                                               RayCounts& traced, double& device_ms) {
  const auto threads = static_cast<std::size_t>(std::max(settings.threads, 1));
  const std::size_t most = std::max(kFilteredTiles, kFilteredTilesOfThread * threads);
  FilteredTiles filtered{*this, call, lit, traced, device_ms};
  for (std::size_t first = 0; first < lit.tiles.size(); first += most) {
    if (lit.is_overtaken && lit.is_overtaken()) break;
    filtered.shade(lit.tiles.subspan(first, std::min(most, lit.tiles.size() - first)));
  }
  return filtered.left;
}

}  // namespace hpr
