#pragma once

#include <cstdint>
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
                          const Scene* covering = nullptr) {
  const TileLayer<Key> keys = cast_keys(covering != nullptr ? *covering : scene, std::span(&view, 1));
  DeferredShader shader(scene, settings);
  glm::dvec3 sum(0.0);
  for (std::uint32_t sample = 0; sample < samples; ++sample) {
    TileLayer<Rgb> radiance(keys.layout());
    shader.shade(std::span(&view, 1), keys, all_tiles(keys.layout()), {.radiance = &radiance}, {.sample = sample});
    for (int y = 0; y < 16; ++y) {
      for (int x = 0; x < 16; ++x) {
        const Rgb& color = radiance.at(0, x, y);
        sum += glm::dvec3(color.r, color.g, color.b);
      }
    }
  }
  return sum / (256.0 * samples);
}

}  // namespace hpr::test
