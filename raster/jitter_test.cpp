#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <string>
#include <vector>

#include "raster/raster_test_scenes.h"

namespace hpr {
namespace {

using namespace test;

struct Corners {
  glm::dvec3 v0;
  glm::dvec3 e1;
  glm::dvec3 e2;
};

std::vector<Corners> world_triangles(const Scene& scene) {
  std::vector<Corners> all;
  for (const Instance& instance : scene.instances) {
    const Mesh& mesh = scene.mesh_of(instance);
    for (const glm::uvec3& triangle : mesh.triangles) {
      const glm::dvec3 v0 = world_position(instance, mesh.positions[triangle.x]);
      all.push_back({v0, world_position(instance, mesh.positions[triangle.y]) - v0,
                     world_position(instance, mesh.positions[triangle.z]) - v0});
    }
  }
  return all;
}

/// The surface a ray meets first beyond the near plane, by trying every triangle (Moeller and Trumbore 1997).
std::uint32_t first_surface(const std::vector<Corners>& triangles, const Ray& ray, double near_distance) {
  double nearest = std::numeric_limits<double>::infinity();
  std::uint32_t found = 0xFFFFFFFFU;
  for (std::uint32_t i = 0; i < triangles.size(); ++i) {
    const Corners& triangle = triangles[i];
    const glm::dvec3 p = glm::cross(ray.direction, triangle.e2);
    const glm::dvec3 from_v0 = ray.origin - triangle.v0;
    const glm::dvec3 q = glm::cross(from_v0, triangle.e1);
    const double determinant = glm::dot(triangle.e1, p);
    const double u = glm::dot(from_v0, p) / determinant;
    const double v = glm::dot(ray.direction, q) / determinant;
    const double t = glm::dot(triangle.e2, q) / determinant;
    if (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= near_distance && t < nearest) {
      nearest = t;
      found = i;
    }
  }
  return found;
}

class JitterTest : public testing::TestWithParam<std::string> {};

INSTANTIATE_TEST_SUITE_P(Backends, JitterTest, testing::ValuesIn(all_gl_backends()),
                         [](const auto& each) { return each.param; });

/// Pixels whose key is not that of the ray through the place `seen` looks at.
std::size_t differing_pixels(const Image<Key>& keys, const std::vector<Corners>& triangles, const View& seen) {
  std::size_t differing = 0;
  for (int y = 0; y < keys.height(); ++y) {
    for (int x = 0; x < keys.width(); ++x) {
      const Key key = keys.at(x, y);
      const std::uint32_t drawn = key == kNoKey ? 0xFFFFFFFFU : key_surface(key);
      differing += drawn == first_surface(triangles, view_ray(seen, x + 0.5, y + 0.5), seen.near_distance) ? 0U : 1U;
    }
  }
  return differing;
}

TEST_P(JitterTest, TheKeysOfAJitteredViewAreThoseOfRaysThroughTheJitteredPositions) {
  const auto context = make_gl_context({.backend = GetParam()});
  Scene scene;
  scene.meshes = {soup(400, 7), waves(12)};
  scene.instances = {placed(0, {0.0, 0.0, 0.0}), placed(1, {0.5, 0.25, 1.0}, 0.4)};
  finish_scene(scene);
  const std::vector<Corners> triangles = world_triangles(scene);
  const View plain = perspective_view({96, 64});
  for (const glm::dvec2 jitter : {glm::dvec2(0.0), glm::dvec2(0.45, -0.3), glm::dvec2(-1.7, 0.9)}) {
    View view = plain;
    view.jitter = jitter;
    const Image<Key> keys = draw_all(*context, scene, view);
    // Places within GL's sub-pixel grid, 1/256, of an edge may fall to either side.
    EXPECT_LE(differing_pixels(keys, triangles, view), 96U * 64U / 100) << jitter.x << ' ' << jitter.y;
    if (jitter != glm::dvec2(0.0)) {
      EXPECT_GT(differing_pixels(keys, triangles, plain), 96U * 64U / 20) << "the scene would not tell";
    }
  }
}

}  // namespace
}  // namespace hpr
