#include <gtest/gtest.h>

#include "rt/denoise/test_denoiser.h"

// What the denoiser shares of smooth surfaces' light.
namespace hpr::test {
namespace {

/// Light that a lacquered surface scatters below its lacquer is filtered as if the surface were diffuse, what it
/// mirrors is not; where there are lamps, whose light is not shared, that of the sky still is.
TEST(Denoiser, DiffuseLightOfSmoothSurfacesIsSharedAsWidely) {
  Scene scene = corner(diffuse(glm::vec3(0.5F)), glm::vec3(0.8F), {0.2F, 0.4F, 0.6F}, 12);
  for (Material& material : scene.materials) {
    material.roughness = 0.0F;
    material.ior = 1.5F;
  }
  for (const bool has_lamp : {false, true}) {
    if (has_lamp) scene.lights.emplace_back().position = {0.0, 5.0, 4.0};
    finish_scene(scene);
    const View view = look(scene, {70, 52});
    RaySettings settings = kGathered;
    settings.passes.push_back(PassId::Reflection);
    const Image<Rgb> truth = mean_picture(scene, view, settings, 96);
    const Image<Rgb> plain = mean_picture(scene, view, settings, 1);
    const Image<Rgb> smooth = mean_picture(scene, view, denoised(settings), 1);
    EXPECT_LT(squared_error(smooth, truth), 0.15 * squared_error(plain, truth)) << has_lamp;
    // The mean of a single sample is off by a percent by chance.
    const Image<Rgb> smoother = mean_picture(scene, view, denoised(settings), 8);
    EXPECT_NEAR(mean(smoother) / mean(truth), 1.0, 0.005) << has_lamp;
  }
}

/// Where rays that gather follow mirrors too, what those show is not taken for diffuse light.
TEST(Denoiser, GatheredMirrorImagesAreNotSharedWidely) {
  Scene scene;
  Material half = mirror(0.5F);
  half.metallic = 0.5F;
  add_material(scene, half);
  add_material(scene, diffuse(glm::vec3(0.0F)));
  place_mesh(scene, add_mesh(scene, quad({-4, 0, 4}, {8, 0, 0}, {0, 0, -8}, 0)));
  for (int i = -4; i < 4; ++i) {
    place_mesh(scene, add_mesh(scene, quad({static_cast<float>(i), 0.2F, -4}, {0.5F, 0, 0}, {0, 6, 0}, 1)));
  }
  scene.environment = even_light({1.0F, 1.0F, 1.0F});
  finish_scene(scene);
  const View view = view_from({0, 4, 6}, {0, 0, -1}, {64, 64}, scene);
  const Image<Rgb> plain = shade(scene, view, kGathered).image;
  const Image<Rgb> smooth = shade(scene, view, denoised(kGathered)).image;
  EXPECT_LT(squared_error(smooth, plain), 0.011);  // 0.0145 if they were
}

/// Light that is sampled comes by all lobes of a smooth surface together.
TEST(Denoiser, TexturesOfSmoothSurfacesStayInSampledLight) {
  Scene scene = painted_floor();
  scene.environment.reset();  // the headlight shines
  scene.materials[0].roughness = 0.2F;
  finish_scene(scene);
  const View view = view_from({0.5, 5, 1}, {0, 0, 0}, {90, 66}, scene);
  const Shaded plain = shade(scene, view, kGathered);
  const Shaded smooth = shade(scene, view, denoised(kGathered));
  EXPECT_GT(mean(plain.image), 0.05);
  expect_same_inside(smooth.image, plain.image, 1e-3F);
}

/// Where roughness crosses the cutoff, what is mirrored is known on one side only, and is not taken from the other.
TEST(Denoiser, NothingIsSharedAcrossTheGlossyCutoff) {
  Scene scene = painted_floor();
  scene.meshes[0].colors.clear();
  Material& floor = scene.materials[0];
  floor = mirror(0.8F);
  floor.metallic = 0.5F;
  floor.roughness = 1.0F;
  floor.metallic_roughness_texture.texture = 0;
  Image<Rgba8> roughness({64, 1}, {0, 60, 255, 255});
  for (int x = 32; x < 64; ++x) roughness.at(x, 0).g = 100;
  scene.textures.emplace_back().image = std::move(roughness);
  finish_scene(scene);
  const View view = view_from({0.5, 5, 1}, {0, 0, 0}, {90, 66}, scene);
  RaySettings settings = kGathered;
  settings.passes.push_back(PassId::Reflection);
  settings.glossy_cutoff = 0.3;
  const Image<Rgb> plain = mean_picture(scene, view, settings, 8);
  const Image<Rgb> smooth = mean_picture(scene, view, denoised(settings), 8);
  for (int x = 12; x < 78; ++x) {
    float off = 0.0F;
    for (int y = 12; y < 54; ++y) off += (smooth.at(x, y).g - plain.at(x, y).g) / 42.0F;
    EXPECT_NEAR(off, 0.0F, 0.005F) << x;  // else 0.0066
  }
}

}  // namespace
}  // namespace hpr::test
