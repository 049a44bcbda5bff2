#pragma once

#include <cmath>
#include <span>
#include <vector>

#include "rt/lights/light_sampler.h"
#include "rt/reference/path_tracer.h"
#include "rt/test_scene.h"
#include "rt/trace/coverage_traversal.h"
#include "rt/trace/ray_scene.h"

/// Path tracing in tests, with the error that chance leaves.
namespace hpr::test {

/// All that path tracing a scene takes.
struct PathBench {
  explicit PathBench(const Scene& traced)
      : scene(traced),
        space(traced),
        surfaces(traced, space),
        opaque(traced, space, 1, covering_surfaces(traced, false)),
        alpha_tested(traced, space, 1, covering_surfaces(traced, true)),
        rays(traced, surfaces, space, opaque, covering_surfaces(traced, true).empty() ? nullptr : &alpha_tested),
        lights(traced) {}
  const Scene& scene;
  RaySpace space;
  Surfaces surfaces;
  RayScene opaque;
  RayScene alpha_tested;
  CoverageTraversal rays;
  LightSampler lights;
};

/// One sample of every pixel, as it is.
inline Image<Rgb> trace(const PathBench& bench, const View& view, const PathSettings& settings,
                        PathCounts* counts = nullptr) {
  TileLayer<Rgb> radiance{FrameLayout({view.size()})};
  PathTracer tracer(bench.scene, bench.rays, bench.lights, settings);
  tracer.trace(std::span(&view, 1), all_tiles(radiance.layout()), {}, {.radiance = &radiance});
  if (counts != nullptr) *counts = tracer.counts();
  return to_image(radiance, 0);
}

/// The mean over a picture and its standard error, from runs that share no random number. Every pixel counts in units
/// of what `expected` says of it.
struct Estimate {
  double mean = 0.0;
  double error = 0.0;
};

template <typename Expected>
Estimate estimate(const PathBench& bench, const View& view, PathSettings settings, int runs, std::uint32_t samples,
                  Expected&& expected) {
  const std::vector<std::size_t> tiles{0};
  TileLayer<Rgb> radiance{FrameLayout({view.size()})};
  HPR_CHECK(radiance.tiles() == 1);
  double sum = 0.0;
  double squares = 0.0;
  for (int run = 0; run < runs; ++run) {
    settings.seed = static_cast<std::uint64_t>(run) + 1;
    PathTracer tracer(bench.scene, bench.rays, bench.lights, settings);
    double of_run = 0.0;
    for (std::uint32_t sample = 0; sample < samples; ++sample) {
      tracer.trace(std::span(&view, 1), tiles, {.sample = sample}, {.radiance = &radiance});
      for (int y = 0; y < view.size().height; ++y) {
        for (int x = 0; x < view.size().width; ++x) of_run += radiance.at(0, x, y).g / expected(x, y);
      }
    }
    of_run /= static_cast<double>(view.size().area()) * samples;
    sum += of_run;
    squares += of_run * of_run;
  }
  Estimate result;
  result.mean = sum / runs;
  result.error = std::sqrt(std::max(squares / runs - result.mean * result.mean, 0.0) / (runs - 1));
  return result;
}

inline Estimate estimate(const PathBench& bench, const View& view, const PathSettings& settings, int runs,
                         std::uint32_t samples) {
  return estimate(bench, view, settings, runs, samples, [](int /*x*/, int /*y*/) { return 1.0; });
}

/// The cube [-1, 1]^3 seen from inside; every face emits `emission` and is of `material` else.
inline Scene closed_box(Material material, double emission) {
  Scene scene;
  material.emissive = glm::vec3(static_cast<float>(emission));
  const std::uint32_t look = add_material(scene, material);
  for (int axis = 0; axis < 3; ++axis) {
    for (const float side : {-1.0F, 1.0F}) {
      glm::vec3 corner(-1.0F);
      corner[axis] = side;
      glm::vec3 a(0.0F);
      glm::vec3 b(0.0F);
      a[(axis + 1) % 3] = 2.0F;
      b[(axis + 2) % 3] = 2.0F;
      place_mesh(scene, add_mesh(scene, side < 0.0F ? quad(corner, a, b, look) : quad(corner, b, a, look)));
    }
  }
  finish_scene(scene);
  return scene;
}

/// White in all directions, of radiance one.
inline Environment white_sky() {
  Environment sky;
  sky.image = Image<Rgb>(Size{1, 1});
  sky.image.at(0, 0) = {1.0F, 1.0F, 1.0F};
  return sky;
}

}  // namespace hpr::test
