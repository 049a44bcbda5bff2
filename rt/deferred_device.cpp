#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/geometric.hpp>
#include <memory>
#include <span>
#include <utility>
#include <vector>

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
class DeferredShader::State::FilteredTiles {
 public:
  FilteredTiles(State& state, const Call& call, DeviceWork& done) : state_(state), call_(call), done_(done) {}

  /// Returns those that the device could not finish.
  [[nodiscard]] std::vector<std::size_t> shade(std::span<const std::size_t> indices) {
    for (const std::size_t index : indices) start(index);
    for_each([this](FilteredTile& tile) { find_points(tile); });
    light();
    const std::span<const ShadedSample> samples = call_.samples;
    for (std::size_t sample = 0; sample < samples.size() && state_.denoises(samples[sample].number); ++sample) {
      if (call_.overtaken()) break;
      for_each([&](FilteredTile& tile) { resample(tile, sample); });
      light();
      for_each([&](FilteredTile& tile) { resolve(tile, sample); });
    }
    for_each([this](FilteredTile& tile) { store(tile); });
    for (FilteredTile& tile : tiles_) state_.tile_memory.put_back(std::move(tile.scratch));
    tiles_.clear();
    return std::exchange(left_, {});
  }

 private:
  void for_each(const std::function<void(FilteredTile&)>& body) {
    state_.for_each(tiles_.size(), [&](std::size_t i) {
      const DenormalsAsZero mode;
      body(tiles_[i]);
    });
  }

  void start(std::size_t index) {
    const ShadedSample& first = call_.samples.front();
    if (!wants_any(mask_of(first.wanted, index))) return;
    for (const ShadedSample& sample : call_.samples) set_active(sample.output, index);
    const std::size_t screen = first.keys->layout().place(index).screen;
    tiles_.push_back({index, state_.jobs_of(call_, {.tile = index}), state_.context_of(call_, screen),
                      state_.tile_memory.take(state_.steps())});
  }

  void find_points(FilteredTile& tile) const {
    const TilePart part{tile.jobs, call_.samples, tile.index, true};
    TileScratch& scratch = *tile.scratch;
    state_.start_tile(tile.context, scratch, part,
                      [&](const std::vector<PathVertex>& points) { tile.add_points(points); });
    std::vector<PathVertex> points;
    for (std::size_t sample = 0; sample < tile.jobs.size(); ++sample) {
      points.clear();
      const RowRange rows{0, tile.jobs[sample].end_row()};
      state_.find_rows(tile.context, scratch, scratch.own, part, sample, rows, points);
      tile.add_points(points);
    }
  }

  /// Has the device light all points.
  void light() {
    const Stopwatch watch;
    std::vector<PointsOfView> groups;
    for (FilteredTile& tile : tiles_) {
      tile.light.assign(tile.points.size(), PointLight{});
      if (!tile.points.empty()) groups.push_back({tile.context.view, tile.context.eye_media, tile.points, tile.light});
    }
    {
      const trace::Span span("light, on the device");
      state_.device->shade_points({groups, call_.samples.front().number, call_.photons, call_.is_overtaken},
                                  done_.traced);
    }
    done_.ms += watch.ms();
    leave_unfinished();
    for_each([](FilteredTile& tile) { tile.add_light(); });
  }

  void leave_unfinished() {
    std::vector<FilteredTile> finished;
    for (FilteredTile& tile : tiles_) {
      if (std::ranges::all_of(tile.light, [](const PointLight& light) { return light.is_unfinished == 0; })) {
        finished.push_back(std::move(tile));
      } else {
        left_.push_back(tile.index);
        state_.tile_memory.put_back(std::move(tile.scratch));
      }
    }
    tiles_.swap(finished);
  }

  void resample(FilteredTile& tile, std::size_t sample) const {
    const Stopwatch watch;
    TileScratch& scratch = *tile.scratch;
    if (sample == 0) {
      tile.fragments =
          &state_.fragments.of_tile(tile.context, scratch.own.buffers, tile.jobs.front(), tile.index, scratch.finder);
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
      scratch.sums.store(tile.jobs[i], tile.index, call_.samples[i].output, scratch.own.buffers.counts);
    }
  }

  State& state_;
  const Call& call_;
  DeviceWork& done_;
  std::vector<FilteredTile> tiles_ = {};
  std::vector<std::size_t> left_ = {};
};

std::vector<std::size_t> DeferredShader::State::light_by_device(const Call& call, std::span<const std::size_t> tiles,
                                                                DeviceWork& done) {
  const ShadedSample& first = call.samples.front();
  if (!device || !wants_light_alone(first.output)) return {tiles.begin(), tiles.end()};
  device->clear_times();
  if (denoises(first.number)) return light_filtered(call, tiles, done);
  const Stopwatch watch;
  std::vector<std::size_t> left =
      shade_on_device(*device, {call.samples, tiles, call.eyes, call.photons, call.is_overtaken}, done.traced);
  done.ms += watch.ms();
  return left;
}

std::vector<std::size_t> DeferredShader::State::light_filtered(const Call& call, std::span<const std::size_t> tiles,
                                                               DeviceWork& done) {
  const auto threads = static_cast<std::size_t>(std::max(settings.threads, 1));
  const std::size_t most = std::max(kFilteredTiles, kFilteredTilesOfThread * threads);
  FilteredTiles filtered(*this, call, done);
  std::vector<std::size_t> left;
  for (std::size_t first = 0; first < tiles.size() && !call.overtaken(); first += most) {
    const std::vector<std::size_t> some = filtered.shade(tiles.subspan(first, std::min(most, tiles.size() - first)));
    left.insert(left.end(), some.begin(), some.end());
  }
  return left;
}

}  // namespace hpr
