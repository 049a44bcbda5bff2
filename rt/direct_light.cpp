#include "rt/direct_light.h"

#include <algorithm>
#include <glm/geometric.hpp>

namespace hpr {

void add_emission(TileWork& tile, const Wave& wave) {
  for (const PathPoint& point : wave.points) tile.radiance[point.pixel] += point.throughput * point.material.emission;
}

void sample_lights(const TileWork& tile, std::size_t first_light, Wave& wave) {
  wave.samples.clear();
  const std::size_t end = std::min(first_light + kLightsAtOnce, tile.lights.size());
  for (std::size_t light = first_light; light < end; ++light) {
    for (std::uint32_t i = 0; i < wave.points.size(); ++i) {
      const PathPoint& point = wave.points[i];
      const LightSample arriving = sample_light(tile.lights[light], point.surface.position, *tile.view);
      const double cosine = glm::dot(point.surface.shading_normal, arriving.to_light);
      if (!(cosine > 0.0) || arriving.irradiance == glm::dvec3(0.0)) continue;
      const glm::dvec3 scattered =
          point.material.brdf.value(point.surface.facing_normal(), arriving.to_light, point.surface.to_viewer);
      if (scattered == glm::dvec3(0.0)) continue;
      wave.samples.push_back({i, static_cast<std::uint32_t>(light), true, arriving.to_light,
                              point.throughput * scattered * arriving.irradiance * cosine});
    }
  }
}

void add_samples(TileWork& tile, const Wave& wave) {
  for (const DirectSample& sample : wave.samples) {
    if (sample.visible) tile.radiance[wave.points[sample.point].pixel] += sample.radiance;
  }
}

}  // namespace hpr
