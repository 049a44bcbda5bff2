#pragma once

#include <array>
#include <cstdint>
#include <glm/gtc/matrix_transform.hpp>
#include <random>
#include <span>
#include <vector>

#include "raster/rasterizer.h"
#include "scene/scene.h"
#include "scene/view.h"

/// Small scenes and shorthands for the tests of raster/.
namespace hpr::test {

inline float uniform(std::mt19937& random, float from, float to) {
  return from + (to - from) * static_cast<float>(random() >> 8U) / 16777216.0F;
}

/// `count` random triangles within two metres of the origin, from a thousandth to four metres long.
inline Mesh soup(std::uint32_t count, std::uint32_t seed) {
  std::mt19937 random(seed);
  Mesh mesh;
  for (std::uint32_t triangle = 0; triangle < count; ++triangle) {
    const float scale = 4.0F / static_cast<float>(1U << (random() % 12U));
    const glm::vec3 center(uniform(random, -2, 2), uniform(random, -2, 2), uniform(random, -2, 2));
    for (int corner = 0; corner < 3; ++corner) {
      mesh.positions.push_back(
          center + scale * glm::vec3(uniform(random, -1, 1), uniform(random, -1, 1), uniform(random, -1, 1)));
      mesh.normals.emplace_back(0.0F, 0.0F, 1.0F);
    }
    mesh.triangles.push_back(glm::uvec3(0U, 1U, 2U) + 3U * triangle);
  }
  return mesh;
}

/// A waved grid of 2 n^2 triangles in [-1, 1]^2, spatially coherent as real meshes are.
inline Mesh waves(std::uint32_t n) {
  Mesh mesh;
  for (std::uint32_t row = 0; row <= n; ++row) {
    for (std::uint32_t column = 0; column <= n; ++column) {
      const float x = 2.0F * static_cast<float>(column) / static_cast<float>(n) - 1.0F;
      const float y = 2.0F * static_cast<float>(row) / static_cast<float>(n) - 1.0F;
      mesh.positions.emplace_back(x, y, 0.25F * (x * x - y * y) + 0.125F * x * y * y);
      mesh.normals.emplace_back(0.0F, 0.0F, 1.0F);
    }
  }
  for (std::uint32_t row = 0; row < n; ++row) {
    for (std::uint32_t column = 0; column < n; ++column) {
      const std::uint32_t corner = row * (n + 1) + column;
      mesh.triangles.emplace_back(corner, corner + 1, corner + n + 1);
      mesh.triangles.emplace_back(corner + 1, corner + n + 2, corner + n + 1);
    }
  }
  return mesh;
}

inline Instance placed(std::uint32_t mesh, const glm::dvec3& at, double angle = 0.0, double scale = 1.0) {
  Instance instance;
  instance.mesh = mesh;
  instance.to_world = glm::translate(glm::dmat4(1.0), at) *
                      glm::rotate(glm::dmat4(1.0), angle, glm::dvec3(0.6, 0.8, 0.0)) *
                      glm::scale(glm::dmat4(1.0), glm::dvec3(scale));
  return instance;
}

/// A soup, and a coherent mesh shown by several instances: turned, mirrored, shrunk, partly behind the eye.
inline Scene mixed_scene() {
  Scene scene;
  scene.meshes = {soup(3000, 7), waves(40)};
  scene.instances = {placed(1, {0.0, 0.0, -3.0}, 0.4, 2.0), placed(0, {0.0, 0.0, 0.0}),
                     placed(1, {1.0, 0.5, 1.0}, 2.0, 0.25), placed(1, {-1.0, -0.5, 0.5}, 1.0),
                     placed(1, {0.0, 1.0, 3.5}, 1.5, 1.5)};
  scene.instances[2].to_world[0] *= -1.0;
  finish_scene(scene);
  return scene;
}

inline View perspective_view(Size size, const glm::dvec3& eye = {0.25, 0.125, 3.0}) {
  View view;
  view.eye = eye;
  view.right = 0.5 * size.width / size.height;
  view.left = -view.right;
  view.top = 0.5;
  view.bottom = -0.5;
  view.near_distance = 0.0625;
  view.screen = size;
  view.block = {0, 0, size.width, size.height};
  return view;
}

inline SurfaceRange all_of(const Scene& scene) {
  return {0, scene.triangles};
}

/// The keys of `parts` of the view, drawn with a share of the scene.
inline Image<Key> draw_parts(GlContext& context, const Scene& scene, std::span<const SurfaceRange> objects,
                             const View& view, std::span<const Rect> parts, Culling culling = Culling::Chunks,
                             int threads = 1) {
  TileLayer<Key> layer(FrameLayout({view.size()}));
  Rasterizer rasterizer(context, scene, objects, threads, {.culling = culling});
  rasterizer.draw(view, 0, parts, layer);
  return to_image(layer, 0);
}

inline Image<Key> draw_all(GlContext& context, const Scene& scene, const View& view,
                           Culling culling = Culling::Chunks) {
  return draw_parts(context, scene, std::array{all_of(scene)}, view,
                    std::array{Rect{0, 0, view.size().width, view.size().height}}, culling);
}

inline std::size_t covered(const Image<Key>& image) {
  return image.pixels().size() - static_cast<std::size_t>(std::ranges::count(image.pixels(), kNoKey));
}

}  // namespace hpr::test
