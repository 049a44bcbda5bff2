#include "rt/tile_shader.h"

#include <algorithm>
#include <set>

#include "core/timing.h"
#include "rt/passes/path_vertex.h"
#include "rt/passes/pixel_sums.h"
#include "rt/photons/photon_tracer.h"

namespace hpr {

bool wants_light_alone(const LightOutput& output) {
  return std::ranges::all_of(output.components, [](const auto* layer) { return layer == nullptr; }) &&
         output.normal == nullptr && output.albedo == nullptr && output.cost == nullptr;
}

std::vector<std::size_t> shade_on_device(TileShader& device, const TilesToShade& lit, RayCounts& traced) {
  const trace::Span span("light, on the device");
  std::set<std::size_t> unfinished;
  device.shade(lit, traced, [&](const ShadedSample& sample, std::size_t tile, std::span<const glm::vec4> pixels) {
    set_active(sample.output, tile);
    if (pixels.empty()) {
      unfinished.insert(tile);
      return;
    }
    const TilePlace location = sample.keys->layout().place(tile);
    const TileJob job{location.pixels,
                      sample.number,
                      sample.keys->tile(tile),
                      &sample.views[location.screen],
                      0,
                      mask_of(sample.wanted, tile)};
    store_shaded(job, tile, pixels, sample.output, traced);
  });
  return {unfinished.begin(), unfinished.end()};
}

void add_photon_times(TileShader& device, int threads, std::vector<PassTime>& times) {
  PhotonDevice* const traces = device.photon_device();
  if (traces == nullptr) return;
  const std::size_t pass = times.size() - 1;
  for (const PassTime& step : traces->take_times()) {
    times.push_back({step.name, step.ms * threads});
    times[pass].ms = std::max(times[pass].ms - times.back().ms, 0.0);
  }
}

void add_times(const TileShader& device, double ms, int threads, std::vector<PassTime>& times) {
  double rest = ms;
  for (const PassTime& step : device.times()) {
    times.push_back({step.name, step.ms * threads});
    rest -= times.back().ms;
  }
  times.push_back({"device rest", std::max(rest, 0.0)});
}

}  // namespace hpr
