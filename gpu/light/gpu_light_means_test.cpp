// What the CPU's light is held to by theory and by the reference, of a device: furnaces, photons against paths, and the
// faults of older renderers (light that depends on a scene's size, surfaces that shadow themselves, lost reflections).
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "gpu/device/test_gpu.h"
#include "gpu/light/gpu_tile_shader.h"
#include "rt/photons/test_photons.h"
#include "rt/test_rooms.h"
#include "rt/test_scene.h"

namespace hpr {
namespace {

/// Counts the tiles that a device lit, and those that it left to the CPU.
class CountingShader final : public TileShader {
 public:
  struct Tiles {
    int lit = 0;
    int left = 0;
  };
  CountingShader(const GpuDevice& device, const ShadingInputs& inputs, Tiles& tiles)
      : by_(device, inputs, 2), tiles_(tiles) {}

  void shade(const TilesToShade& lit, RayCounts& counts, const Store& store) override {
    by_.shade(lit, counts, [&](const ShadedSample& sample, std::size_t tile, std::span<const glm::vec4> pixels) {
      ++(pixels.empty() ? tiles_.left : tiles_.lit);
      store(sample, tile, pixels);
    });
  }
  void shade_points(const PointsToShade& lit, RayCounts& counts) override { by_.shade_points(lit, counts); }
  [[nodiscard]] PhotonDevice* photon_device() override { return by_.photon_device(); }
  [[nodiscard]] std::span<const PassTime> times() const override { return by_.times(); }
  void clear_times() override { by_.clear_times(); }

 private:
  GpuTileShader by_;
  Tiles& tiles_;
};

class GpuLightMeans : public test::OnGpu {
 protected:
  [[nodiscard]] MakeTileShader on_device() {
    return [this](const ShadingInputs& inputs) {
      EXPECT_EQ(refusal_of_light(inputs.scene, inputs.settings), "");
      return std::make_unique<CountingShader>(device(), inputs, tiles_);
    };
  }
  void TearDown() override {
    if (!IsSkipped()) {
      EXPECT_GT(tiles_.lit, 0);
      EXPECT_EQ(tiles_.left, 0);
    }
    OnGpu::TearDown();
  }

 private:
  CountingShader::Tiles tiles_;
};

TEST_F(GpuLightMeans, WhiteAndMirroringFloorsVanishInAnEvenSky) {
  for (const Material& material : {test::diffuse(), test::mirror(1.0F)}) {
    Scene scene = test::white_floor();
    scene.materials[0] = material;
    scene.environment = test::even_light({1.0F, 1.0F, 1.0F});
    finish_scene(scene);
    const View view = test::view_from({0.5, 1, 4.5}, {0, 0, 0}, {24, 24}, scene, 0.9);
    RaySettings settings;
    settings.background.kind = Background::Kind::Environment;
    const test::Shaded lit = test::shade(scene, view, settings, on_device());
    for (const Rgb& color : lit.image.pixels()) {
      ASSERT_NEAR(color.r, 1.0F, 1e-5F);
      ASSERT_NEAR(color.g, 1.0F, 1e-5F);
      ASSERT_NEAR(color.b, 1.0F, 1e-5F);
    }
  }
}

TEST_F(GpuLightMeans, ABallOfHalfGlassInAFurnaceGivesBackNoMoreThanArrives) {
  for (const float roughness : {0.0F, 0.4F}) test::expect_no_more_than_arrives(roughness, 4, on_device());
}

TEST_F(GpuLightMeans, PhotonsInAClosedBoxAreAsBrightAsItsSeriesSums) {
  test::expect_light_of_series(0.8, {.photons = 20'000, .global_photons = true}, 4, on_device());
}

TEST_F(GpuLightMeans, PhotonsAndRaysBringTheLightOfPaths) {
  test::expect_light_of_reference(test::room(test::clear_glass(1.5F, 1.0F), false), 7'000, on_device());
}

TEST_F(GpuLightMeans, APointLightOverAWhitePlaneGivesTheAnalyticRadiance) {
  test::expect_light_of_a_point(on_device());
}

TEST_F(GpuLightMeans, NoSphereShadowsItselfAtAnyScale) {
  for (const double scale : {1e-9, 1e9}) test::expect_no_shadow_on_itself(scale, 100.0, on_device());
}

TEST_F(GpuLightMeans, LightOfAnyStrengthAndSizeIsTheSameButForItsUnit) {
  test::expect_light_of_any_strength_and_size(on_device());
}

}  // namespace
}  // namespace hpr
