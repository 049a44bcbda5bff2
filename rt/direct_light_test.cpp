#include "rt/direct_light.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "rt/test_scene.h"

namespace hpr {
namespace {

Scene white_floor() {
  Scene scene;
  test::add_material(scene, test::matte());
  test::place(scene, test::add_mesh(scene, test::quad({-4, 0, 4}, {8, 0, 0}, {0, 0, -8}, 0)));
  finish_scene(scene);
  return scene;
}

/// A tile all of whose pixels see a white floor.
class DirectLightTest : public testing::Test {
 protected:
  DirectLightTest() {
    view_ = test::view_from({0, 3, 0.1}, {0, 0, 0}, {kTileSide, kTileSide}, scene_, 0.5);
    tile_.radiance.assign(kTilePixels, glm::dvec3(0.0));
    tile_.view = &view_;
    WorldTriangle triangle;
    for (std::uint32_t pixel = 0; pixel < kTilePixels; ++pixel) {
      const Ray ray = view_ray(view_, pixel % kTileSide + 0.5, static_cast<int>(pixel) / kTileSide + 0.5);
      surfaces_.load(0, triangle);
      PathPoint& point = wave_.points.emplace_back();
      point.surface = surfaces_.meet(triangle, ray.origin, ray.direction);
      point.material = evaluate_material(scene_, scene_.materials[0], point.surface.uv);
      point.pixel = pixel;
    }
  }

  void set_lights(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      Light light;
      light.position = {0.01 * static_cast<double>(i), 2.0, 0.0};
      light.intensity = glm::vec3(1.0F + 0.1F * static_cast<float>(i));
      lights_.push_back(light);
    }
    tile_.lights = lights_;
  }

  Scene scene_ = white_floor();
  RaySpace space_;
  Surfaces surfaces_{scene_, space_};
  View view_;
  std::vector<Light> lights_;
  TileWork tile_{.scene = scene_,
                 .surfaces = surfaces_,
                 .space = space_,
                 .rays = nullptr,
                 .lights = {},
                 .max_depth = 0,
                 .radiance = {},
                 .counts = {},
                 .batch = {},
                 .blocked = {},
                 .hits = {}};
  Wave wave_;
};

TEST_F(DirectLightTest, ItsMemoryDoesNotGrowWithTheNumberOfLights) {
  set_lights(203);
  std::size_t samples = 0;
  for (std::size_t light = 0; light < lights_.size(); light += kLightsAtOnce) {
    sample_lights(tile_, light, wave_);
    samples += wave_.samples.size();
  }
  EXPECT_EQ(samples, lights_.size() * kTilePixels) << "every light reaches every pixel, in one block or another";
  EXPECT_LE(wave_.samples.capacity() * sizeof(DirectSample), std::size_t{8} << 20);
}

TEST_F(DirectLightTest, LightsAreAddedInTheirOrderWhateverTheBlocks) {
  set_lights(19);
  for (std::size_t light = 0; light < lights_.size(); light += kLightsAtOnce) {
    sample_lights(tile_, light, wave_);
    add_samples(tile_, wave_);
  }
  for (const PathPoint& point : wave_.points) {
    glm::dvec3 sum(0.0);
    for (const Light& light : lights_) {
      const LightSample arriving = sample_light(light, point.surface.position, view_);
      const glm::dvec3 scattered =
          point.material.brdf.value(point.surface.shading_normal, arriving.to_light, point.surface.to_viewer);
      sum += point.throughput * scattered * arriving.irradiance *
             glm::dot(point.surface.shading_normal, arriving.to_light);
    }
    ASSERT_EQ(tile_.radiance[point.pixel], sum) << point.pixel;
  }
}

TEST_F(DirectLightTest, HiddenSamplesAddNothing) {
  set_lights(2);
  sample_lights(tile_, 0, wave_);
  for (DirectSample& sample : wave_.samples) sample.visible = sample.point % 3 != 0;
  add_samples(tile_, wave_);
  for (std::uint32_t i = 0; i < kTilePixels; ++i) EXPECT_EQ(tile_.radiance[i].g > 0.0, i % 3 != 0) << i;
}

}  // namespace
}  // namespace hpr
