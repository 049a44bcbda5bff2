#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <glm/gtc/matrix_transform.hpp>
#include <numbers>
#include <span>

#include "rt/deferred_shader.h"
#include "rt/test_scene.h"

namespace hpr::test {

/// A closed room of coloured walls under a lamp, with something in the middle.
inline Scene room(const Material& thing, bool is_sheet) {
  Scene scene;
  const std::uint32_t white = add_material(scene, diffuse(glm::vec3(0.7F)));
  const std::uint32_t red = add_material(scene, diffuse({0.6F, 0.1F, 0.1F}));
  const std::uint32_t green = add_material(scene, diffuse({0.1F, 0.5F, 0.1F}));
  Material glow = diffuse(glm::vec3(0.7F));
  glow.emissive = glm::vec3(12.0F, 10.0F, 8.0F);
  const std::uint32_t lamp = add_material(scene, glow);
  const std::uint32_t special = add_material(scene, thing);
  const auto side = [&](glm::vec3 corner, glm::vec3 a, glm::vec3 b, std::uint32_t material) {
    place_mesh(scene, add_mesh(scene, quad(corner, a, b, material)));
  };
  side({-1, -1, -1}, {2, 0, 0}, {0, 2, 0}, white);
  side({-1, -1, 1}, {0, 2, 0}, {2, 0, 0}, white);
  side({-1, -1, -1}, {0, 2, 0}, {0, 0, 2}, red);
  side({1, -1, -1}, {0, 0, 2}, {0, 2, 0}, green);
  side({-1, -1, -1}, {0, 0, 2}, {2, 0, 0}, white);
  side({-1, 1, -1}, {2, 0, 0}, {0, 0, 2}, white);
  side({-0.4F, 0.98F, -0.4F}, {0.8F, 0, 0}, {0, 0, 0.8F}, lamp);
  if (is_sheet) {
    side({-0.6F, -0.9F, 0.1F}, {1.2F, 0, 0}, {0, 1.2F, 0.2F}, special);
  } else {
    place_mesh(scene, add_mesh(scene, sphere(0.45, 64, special)),
               glm::dmat4(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -0.5, 0, 1));
  }
  finish_scene(scene);
  return scene;
}

/// A room's floor and back, of two materials, with a sphere between, under an even sky.
inline Scene corner(const Material& ball, glm::vec3 floor = glm::vec3(0.8F),
                    glm::vec3 back = glm::vec3(0.2F, 0.4F, 0.6F), int rings = 24) {
  Scene scene;
  add_material(scene, diffuse(floor));
  add_material(scene, diffuse(back));
  add_material(scene, ball);
  place_mesh(scene, add_mesh(scene, quad({-4, 0, 4}, {8, 0, 0}, {0, 0, -8}, 0)));
  place_mesh(scene, add_mesh(scene, quad({-4, 0, -4}, {8, 0, 0}, {0, 6, 0}, 1)));
  place_mesh(scene, add_mesh(scene, sphere(1.0, rings, 2)), glm::dmat4(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 1, 0, 1));
  scene.environment = even_light({1.0F, 1.0F, 1.0F});
  finish_scene(scene);
  return scene;
}

/// Calls body(radiance) for so many frames of one sample each, at other places of the pixels.
template <typename Body>
void for_each_shaken(const Scene& scene, const View& view, const RaySettings& settings, std::uint32_t frames,
                     const Body& body) {
  DeferredShader shader(scene, settings);
  for (std::uint32_t i = 0; i < frames; ++i) {
    View shaken = view;
    shaken.jitter = Sampler(7, i).two() - 0.5;
    const TileLayer<Key> keys = cast_keys(scene, std::span(&shaken, 1));
    TileLayer<Rgb> radiance(keys.layout());
    shader.shade(std::span(&shaken, 1), keys, all_tiles(keys.layout()), {.radiance = &radiance}, {.frame = i});
    body(radiance);
  }
}

/// Keys are those of `covering`, what of the scene covers all behind it; null: all of it.
inline glm::dvec3 mean_of(const Scene& scene, const View& view, const RaySettings& settings, std::uint32_t samples,
                          const Scene* covering = nullptr, const MakeTileShader& make_device = {}) {
  const TileLayer<Key> keys = cast_keys(covering != nullptr ? *covering : scene, std::span(&view, 1));
  DeferredShader shader(scene, settings, requirements_of(scene), {}, nullptr, make_device);
  glm::dvec3 sum(0.0);
  for (std::uint32_t sample = 0; sample < samples; ++sample) {
    TileLayer<Rgb> radiance(keys.layout());
    shader.shade(std::span(&view, 1), keys, all_tiles(keys.layout()), {.radiance = &radiance}, {.sample = sample});
    for (int y = 0; y < view.size().height; ++y) {
      for (int x = 0; x < view.size().width; ++x) {
        const Rgb& color = radiance.at(0, x, y);
        sum += glm::dvec3(color.r, color.g, color.b);
      }
    }
  }
  return sum / (static_cast<double>(view.size().area()) * samples);
}

/// Expects the inverse-square law of a lamp above a white floor.
inline void expect_light_of_a_point(const MakeTileShader& make_device = {}) {
  Scene scene = white_floor();
  Light lamp;
  lamp.position = {0.1, 2.0, 0.1};
  lamp.intensity = glm::vec3(7.0F);
  scene.lights = {lamp};
  // Narrow, and with the light near the eye's axis: there the specular layer's share is below 1e-7.
  const View view = view_from({0, 5, 0.1}, {0, 0, 0}, {65, 33}, scene, 0.1);
  const Shaded lit = shade(scene, view, {}, make_device);
  for (int y = 0; y < 33; ++y) {
    for (int x = 0; x < 65; ++x) {
      const Ray ray = view_ray(view, x + 0.5, y + 0.5);
      const glm::dvec3 p = ray.origin - ray.direction * (ray.origin.y / ray.direction.y);
      const glm::dvec3 offset = lamp.position - p;
      const double d2 = glm::dot(offset, offset);
      const double expected = 7.0 * (offset.y / std::sqrt(d2)) / (std::numbers::pi * d2);
      ASSERT_NEAR(lit.image.at(x, y).g / expected, 1.0, 1e-6) << x << ',' << y;
    }
  }
  EXPECT_EQ(lit.counts[PassId::Shadow], 65U * 33U);
  EXPECT_EQ(lit.counts.not_finite, 0U);
}

/// Expects a ball of radius `scale`, `offset` radii from the origin, to keep no light of suns off itself.
inline void expect_no_shadow_on_itself(double scale, double offset, const MakeTileShader& make_device = {}) {
  Scene scene;
  add_material(scene, diffuse());
  const std::uint32_t ball = add_mesh(scene, sphere(1.0, 16, 0));
  const glm::dvec3 center = scale * offset * glm::dvec3(1.0, 0.5, -0.3);
  place_mesh(scene, ball, glm::scale(glm::translate(glm::dmat4(1.0), center), glm::dvec3(scale)));
  finish_scene(scene);
  Light sun;
  sun.type = LightType::Directional;
  sun.direction = glm::normalize(glm::vec3(-0.8F, -0.5F, -0.2F));
  scene.lights.assign(8, sun);
  const View view = view_from(center + glm::dvec3(0, 0, 4.0 * scale), center, {64, 64}, scene, 0.6);
  const Shaded lit = shade(scene, view, {}, make_device);
  const Shaded unshadowed = shade(scene, view, {.auto_passes = false}, make_device);
  int differing = 0;
  int lit_pixels = 0;
  for (std::size_t i = 0; i < lit.image.pixels().size(); ++i) {
    differing += lit.image.pixels()[i] == unshadowed.image.pixels()[i] ? 0 : 1;
    lit_pixels += unshadowed.image.pixels()[i].r > 0.0F ? 1 : 0;
  }
  EXPECT_EQ(differing, 0) << scale << ' ' << offset;
  EXPECT_GT(lit_pixels, 500);
}

/// Expects the reference's light in the mean, within 4 %, of a room's photons, so many a sample, and rays together.
inline void expect_light_of_reference(const Scene& scene, std::uint32_t photons = 10'000,
                                      const MakeTileShader& make_device = {}) {
  const View view = view_from({0, 0, 0.95}, {0, -0.25, -1}, {12, 12}, scene, 1.3);
  const glm::dvec3 reference = mean_of(scene, view, {.max_depth = 32, .terminator_fix = false, .reference = true}, 256);
  const RaySettings hybrid{.max_depth = 24, .photons = photons, .global_photons = true, .terminator_fix = false};
  const glm::dvec3 light = mean_of(scene, view, hybrid, 16, nullptr, make_device);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(light[c] / reference[c], 1.0, 0.04) << "channel " << c;
}

/// Expects that a ball of glass that transmits half, under an even sky, gives back no more than arrives, and the
/// reference's light in the mean.
inline void expect_no_more_than_arrives(float roughness, std::uint32_t samples,
                                        const MakeTileShader& make_device = {}) {
  Material glass = clear_glass(1.5F, 1.0F);
  glass.transmission = 0.5F;
  glass.base_color = glm::vec4(0.9F, 0.9F, 0.9F, 1.0F);
  glass.roughness = roughness;
  Scene scene;
  place_mesh(scene, add_mesh(scene, sphere(1.0, 32, add_material(scene, glass))));
  scene.environment = even_light({1.0F, 1.0F, 1.0F});
  finish_scene(scene);
  const View view = view_from({0, 0, 4}, {0, 0, 0}, {16, 16}, scene, 0.45);
  const glm::dvec3 reference = mean_of(scene, view, {.max_depth = 64, .terminator_fix = false, .reference = true}, 64);
  const RaySettings best{.max_depth = 24, .photons = 20'000, .global_photons = true, .terminator_fix = false};
  const glm::dvec3 hybrid = mean_of(scene, view, best, samples, nullptr, make_device);
  for (const glm::dvec3& light : {reference, hybrid}) {
    EXPECT_LE(light.g, 1.0) << roughness;
    EXPECT_GT(light.g, 0.6) << roughness;
  }
  EXPECT_NEAR(hybrid.g / reference.g, 1.0, 0.025) << roughness;
}

}  // namespace hpr::test
