#include "rt/lights/direct_light.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "rt/passes/path_vertex.h"
#include "rt/test_scene.h"

namespace hpr {
namespace {

using test::white_floor;

/// A tile all of whose pixels see a white floor under some point lights.
class LitFloor {
 public:
  explicit LitFloor(std::size_t lights) {
    for (std::size_t i = 0; i < lights; ++i) {
      Light light;
      light.position = {0.01 * static_cast<double>(i), 2.0, 0.0};
      light.intensity = glm::vec3(1.0F + 0.1F * static_cast<float>(i));
      scene.lights.push_back(light);
    }
    set.emplace(scene);
    view = test::view_from({0, 3, 0.1}, {0, 0, 0}, {kTileSide, kTileSide}, scene, 0.5);
    context.emplace(LightContext{
        .scene = scene, .surfaces = surfaces, .rays = nullptr, .lights = *set, .settings = settings, .view = &view});
    sums.radiance.assign(kTilePixels, glm::dvec3(0.0));
    WorldTriangle triangle;
    surfaces.load(0, triangle);
    for (std::uint32_t pixel = 0; pixel < kTilePixels; ++pixel) {
      const Ray ray = view_ray(view, pixel % kTileSide + 0.5, static_cast<int>(pixel) / kTileSide + 0.5);
      PathVertex& point = wave.vertices.emplace_back(surfaces, triangle, ray.origin, ray.direction);
      point.pixel = pixel;
      point.sampler = Sampler(pixel, 0);
      finish_vertex(*context, point);
    }
  }

  Scene scene = white_floor();
  RaySpace space;
  Surfaces surfaces{scene, space};
  View view;
  RaySettings settings;
  std::optional<LightSampler> set;
  std::optional<LightContext> context;
  PixelSums sums;
  Wavefront wave;
};

TEST(DirectLight, ItsMemoryDoesNotGrowWithTheNumberOfLights) {
  LitFloor floor(LightSampler::kMaxEnumerated);
  std::size_t samples = 0;
  for (DirectLight light(*floor.context, floor.wave); light.sample_next();) samples += floor.wave.samples.size();
  EXPECT_EQ(samples, LightSampler::kMaxEnumerated * kTilePixels)
      << "every light reaches every pixel, in one block or another";
  EXPECT_LE(floor.wave.samples.capacity() * sizeof(DirectSample), std::size_t{16} << 20);
}

TEST(DirectLight, FewLightsAreAddedInTheirOrderWhateverTheBlocks) {
  LitFloor floor(19);
  for (DirectLight light(*floor.context, floor.wave); light.sample_next();) add_samples(floor.wave, floor.sums);
  for (const PathVertex& point : floor.wave.vertices) {
    glm::dvec3 sum(0.0);
    for (std::size_t i = 0; i < floor.set->enumerated(); ++i) {
      const LightSample light = floor.set->sample_enumerated(i, point.surface.position, floor.view, {});
      glm::dvec3 scattered(0.0);
      for (const Lobe lobe : kLobes) scattered += point.bsdf.value(lobe, light.to_light);
      sum += point.throughput * scattered * light.weight * std::abs(glm::dot(point.material.normal, light.to_light));
    }
    ASSERT_EQ(floor.sums.radiance[point.pixel], sum) << point.pixel;
  }
}

TEST(DirectLight, ManyLightsAreSampledAndRightInTheMean) {
  LitFloor few(LightSampler::kMaxEnumerated);
  LitFloor many(LightSampler::kMaxEnumerated + 1);
  ASSERT_EQ(many.set->enumerated(), 0U);
  Scene last = white_floor();
  last.lights = {many.scene.lights.back()};
  const LightSampler one(last);
  const auto total = [](const LitFloor& floor) {
    double sum = 0.0;
    for (const glm::dvec3& light : floor.sums.radiance) sum += light.g;
    return sum;
  };
  for (DirectLight light(*few.context, few.wave); light.sample_next();) add_samples(few.wave, few.sums);
  for (const PathVertex& point : few.wave.vertices) {
    const LightSample light = one.sample_enumerated(0, point.surface.position, few.view, {});
    for (const Lobe lobe : kLobes) {
      few.sums.radiance[point.pixel] += point.bsdf.value(lobe, light.to_light) * light.weight *
                                        std::abs(glm::dot(point.material.normal, light.to_light));
    }
  }
  many.settings.light_samples = 16;
  for (DirectLight light(*many.context, many.wave); light.sample_next();) add_samples(many.wave, many.sums);
  EXPECT_NEAR(total(many) / total(few), 1.0, 5e-3);
}

TEST(DirectLight, HiddenSamplesAddNothing) {
  LitFloor floor(2);
  DirectLight light(*floor.context, floor.wave);
  ASSERT_TRUE(light.sample_next());
  for (DirectSample& sample : floor.wave.samples) sample.visible = sample.point % 3 != 0 ? 1.0F : 0.0F;
  add_samples(floor.wave, floor.sums);
  for (std::uint32_t i = 0; i < kTilePixels; ++i) EXPECT_EQ(floor.sums.radiance[i].g > 0.0, i % 3 != 0) << i;
  EXPECT_FALSE(light.sample_next());
}

}  // namespace
}  // namespace hpr
