// Materials with extensions in a room: all passes together are held to the reference, photons included.
#include <gtest/gtest.h>

#include <functional>

#include "rt/test_rooms.h"
#include "rt/test_scene.h"

namespace hpr {
namespace {

void expect_the_same_light(const Material& thing, bool is_sheet = false) {
  test::expect_light_of_reference(test::room(thing, is_sheet));
}

Material with(Material material, const std::function<void(MaterialExtensions&)>& set) {
  MaterialExtensions extensions;
  set(extensions);
  material.extensions = std::make_shared<const MaterialExtensions>(extensions);
  return material;
}

Material plastic(float roughness) {
  Material material = test::diffuse({0.3F, 0.4F, 0.6F});
  material.ior = 1.5F;
  material.roughness = roughness;
  return material;
}

TEST(Extensions, ABallWithoutItsReflection) {
  expect_the_same_light(with(plastic(0.1F), [](MaterialExtensions& e) {
    e.specular = 0.3F;
    e.specular_color = {4.0F, 1.0F, 0.5F};
  }));
}

TEST(Extensions, ABallOfASmoothCoat) {
  expect_the_same_light(with(plastic(0.6F), [](MaterialExtensions& e) { e.clearcoat = 1.0F; }));
}

TEST(Extensions, ABallOfACoatThatPhotonsLight) {
  Material metal = test::mirror(0.8F);
  metal.roughness = 0.15F;
  expect_the_same_light(with(metal, [](MaterialExtensions& e) {
    e.clearcoat = 1.0F;
    e.clearcoat_roughness = 0.5F;
  }));
}

TEST(Extensions, ABallOfVelvet) {
  expect_the_same_light(with(plastic(0.8F), [](MaterialExtensions& e) {
    e.sheen_color = {0.9F, 0.6F, 0.3F};
    e.sheen_roughness = 0.5F;
  }));
}

TEST(Extensions, ABallOfBrushedMetal) {
  for (const float roughness : {0.2F, 0.5F}) {
    Material metal = test::mirror(0.9F);
    metal.roughness = roughness;
    expect_the_same_light(with(metal, [](MaterialExtensions& e) { e.anisotropy = 0.8F; }));
  }
}

TEST(Extensions, ABallUnderAFilm) {
  expect_the_same_light(with(plastic(0.2F), [](MaterialExtensions& e) { e.iridescence = 1.0F; }));
}

TEST(Extensions, AGlassBallThatDisperses) {
  expect_the_same_light(with(test::clear_glass(1.5F, 1.0F), [](MaterialExtensions& e) { e.dispersion = 2.0F; }));
}

TEST(Extensions, ALeaf) {
  expect_the_same_light(with(plastic(0.4F),
                             [](MaterialExtensions& e) {
                               e.diffuse_transmission = 0.6F;
                               e.diffuse_transmission_color = {0.4F, 0.9F, 0.3F};
                             }),
                        true);
}

TEST(Extensions, ABallOfWax) {
  Material wax = plastic(0.4F);
  wax.thickness = 1.0F;
  wax.attenuation_color = {0.9F, 0.5F, 0.3F};
  wax.attenuation_distance = 0.5F;
  expect_the_same_light(with(wax, [](MaterialExtensions& e) { e.diffuse_transmission = 0.8F; }));
}

/// A colour of wavelength: the edge of the light that a prism lets through is not white.
TEST(Extensions, GlassThatDispersesMakesColors) {
  const Material glass = test::clear_glass(1.5F, 1.0F);
  const auto seen = [&](float dispersion) {
    Scene lens;
    const std::uint32_t ball =
        test::add_material(lens, with(glass, [&](MaterialExtensions& e) { e.dispersion = dispersion; }));
    test::place_mesh(lens, test::add_mesh(lens, test::sphere(1.0, 48, ball)));
    lens.environment = Environment{Image<Rgb>({64, 32}), 0.0, 1.0};
    for (int y = 0; y < 32; ++y) {
      for (int x = 32; x < 64; ++x) lens.environment->image.at(x, y) = {1.0F, 1.0F, 1.0F};
    }
    finish_scene(lens);
    const View view = test::view_from({0, 0, 4}, {0, 0, 0}, {12, 1}, lens, 0.05);
    double colored = 0.0;
    for (int x = 0; x < 12; ++x) {
      const glm::dvec3 color = test::mean_pixel(lens, view, x, 0, 128, {.max_depth = 16});
      colored = std::max(colored, std::abs(color.r - color.b));
    }
    return colored;
  };
  EXPECT_LT(seen(0.0F), 1e-9);
  EXPECT_GT(seen(5.0F), 0.05);
}

/// A ray for each channel: no sample of the eye's is of one color.
TEST(Extensions, GlassThatDispersesIsOfAllChannelsInEverySample) {
  Scene lens;
  const std::uint32_t ball =
      test::add_material(lens, with(test::clear_glass(1.5F, 1.0F), [](MaterialExtensions& e) { e.dispersion = 5.0F; }));
  test::place_mesh(lens, test::add_mesh(lens, test::sphere(1.0, 48, ball)));
  lens.environment = test::even_light({1.0F, 0.5F, 0.25F});
  finish_scene(lens);
  const View view = test::view_from({0, 0, 4}, {0, 0, 0}, {8, 1}, lens, 0.4);
  for (int x = 0; x < 8; ++x) {
    const glm::dvec3 color = test::mean_pixel(lens, view, x, 0, 1, {.max_depth = 16});
    EXPECT_NEAR(color.g / color.r, 0.5, 0.05) << x;
    EXPECT_NEAR(color.b / color.r, 0.25, 0.025) << x;
  }
}

}  // namespace
}  // namespace hpr
