#include "gpu/light/gpu_surfaces.h"

#include <hpr/shaders/surface_points.h>
#include <hpr/shaders/traced_rays.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <random>
#include <span>
#include <vector>

#include "gpu/device/test_kernels.h"
#include "gpu/gpu_scene.h"
#include "rt/test_scene.h"
#include "rt/trace/ray_scene.h"
#include "rt/trace/surfaces.h"

namespace hpr {
namespace {

using GpuSurfacesTest = test::OnGpu;
using test::add_material;
using test::add_mesh;
using test::place_mesh;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Balls with normal maps, vertex colours, veils and mirrored placements above a wide ground.
Scene many_kinds() {
  Scene scene;
  scene.textures.emplace_back();
  scene.textures[0].image = Image<Rgba8>({2, 2});
  Material mapped = test::diffuse();
  mapped.normal_texture.texture = 0;
  mapped.normal_texture.transform = {2.0F, 0.3F, -0.2F, 1.5F, 0.1F, 0.2F};
  mapped.double_sided = false;
  Material veil = test::diffuse();
  veil.alpha_mode = AlphaMode::Blend;
  const std::uint32_t plain = add_material(scene, test::diffuse());
  const std::uint32_t with_map = add_material(scene, mapped);
  const std::uint32_t covering = add_material(scene, veil);
  Mesh ball = test::sphere(0.7, 9, with_map);
  for (const glm::vec3& p : ball.positions) {
    ball.uvs[0].emplace_back(p.x + 0.4F * p.y, p.z - p.y);
    ball.colors.emplace_back(0.5F + 0.4F * p, 1.0F);
  }
  Mesh with_tangents = ball;
  for (const glm::vec3& n : ball.normals) with_tangents.tangents.emplace_back(n.z, n.x, n.y, n.x > 0.0F ? 1.0F : -1.0F);
  const std::uint32_t a = add_mesh(scene, ball);
  const std::uint32_t b = add_mesh(scene, with_tangents);
  const std::uint32_t c = add_mesh(scene, test::sphere(0.5, 6, covering));
  const std::uint32_t ground = add_mesh(scene, test::quad({-3000, -1, 3000}, {6000, 0, 0}, {0, 0, -6000}, plain));
  const auto placed = [](double x, const glm::dvec3& scale, double turned) {
    const glm::dmat4 there = glm::translate(glm::dmat4(1.0), glm::dvec3(x, 0.0, -0.3 * x));
    return glm::scale(glm::rotate(there, turned, glm::dvec3(0.3, 1.0, 0.1)), scale);
  };
  place_mesh(scene, ground);
  place_mesh(scene, a, placed(-2.0, {1, 1, 1}, 0.3));
  place_mesh(scene, a, placed(-0.7, {-1, 1, 0.6}, 2.0));
  place_mesh(scene, b, placed(0.7, {1, 0.4, 1}, 1.0));
  place_mesh(scene, b, placed(1.5, {1, 1, -2}, 0.0));
  place_mesh(scene, c, placed(3.0, {1, 1, 1}, 0.0));
  place_mesh(scene, c, placed(1e4, {30, 30, 30}, 0.0));
  finish_scene(scene);
  return scene;
}

struct Meeting {
  glm::dvec3 origin;
  glm::dvec3 direction;
  std::uint32_t surface = 0;
  std::uint32_t padding = 0;
};
/// As surface_points.comp writes them.
struct FoundPoint {
  std::array<glm::dvec3, 7> vectors;
  double offset;
  glm::dvec4 color;
  std::array<glm::vec2, 2> uv;
  std::uint32_t material;
  std::uint32_t layer;
  std::uint32_t inside;
  std::uint32_t padding;
};

glm::dvec3 random_direction(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return glm::normalize(glm::dvec3(normal(random), normal(random), normal(random)));
}

TEST_F(GpuSurfacesTest, PointsAreThoseOfTheCpu) {
  const Scene scene = many_kinds();
  const Surfaces surfaces(scene, RaySpace(scene));
  std::mt19937 random(3);
  std::vector<Meeting> meetings(100'000);
  std::vector<SurfacePoint> expected;
  for (std::size_t i = 0; i < meetings.size(); ++i) {
    std::uniform_real_distribution<double> number(0.0, 1.0);
    WorldTriangle triangle;
    const auto surface = static_cast<std::uint32_t>(random() % scene.triangles);
    surfaces.load(surface, triangle);
    const double u = number(random);
    const double v = (1.0 - u) * number(random);
    const double beside = i % 10 == 0 ? 1.001 : 1.0;  // some miss the triangle by a little
    const glm::dvec3 goal = triangle.v0 + beside * u * triangle.e1 + beside * v * triangle.e2;
    const glm::dvec3 direction = random_direction(random) * (i % 3 == 0 ? 1.0 : 1.7);
    meetings[i] = {goal - direction * (5.0 * number(random)), direction, surface};
    expected.push_back(surfaces.meet(triangle, meetings[i].origin, direction));
  }
  const GpuSurfaces placed(device(), scene, surfaces);
  const std::vector<FoundPoint> found =
      test::map_on_gpu<FoundPoint>(device(), surface_points, std::span<const Meeting>(meetings), placed.address());
  std::size_t with_tangents = 0;
  std::size_t with_lift = 0;
  std::size_t flat_maps = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const SurfacePoint& point = expected[i];
    const std::array vectors{point.position, point.to_viewer, point.geometric_normal, point.shading_normal,
                             point.lift,     point.tangent,   point.bitangent};
    for (std::size_t k = 0; k < vectors.size(); ++k) {
      const double scale = std::max(glm::length(vectors.at(k)), 1.0);
      const double off = glm::distance(found[i].vectors.at(k), vectors.at(k));
      // Which of two ways a map's y goes is a matter of rounding where its coordinates have no area.
      const bool turned = k == 6 && glm::distance(found[i].vectors.at(k), -vectors.at(k)) < 1e-9;
      flat_maps += off > 1e-9 * scale && turned ? 1U : 0U;
      ASSERT_TRUE(turned || off <= 1e-9 * scale) << i << " vector " << k << " off by " << off;
    }
    with_tangents += glm::length(point.tangent) > 0.5 ? 1U : 0U;
    with_lift += glm::length(point.lift) > 1e-6 ? 1U : 0U;
    ASSERT_NEAR(found[i].offset, point.offset, 1e-9 * point.offset) << i;
    ASSERT_LE(glm::distance(found[i].color, point.color), 1e-9) << i;
    for (std::size_t set = 0; set < 2; ++set) {
      ASSERT_LE(glm::distance(found[i].uv.at(set), point.uv.at(set)), 1e-5F) << i;
    }
    ASSERT_EQ(found[i].material, point.material) << i;
    ASSERT_EQ(found[i].layer, point.layer) << i;
    ASSERT_EQ(found[i].inside != 0, point.inside) << i;
  }
  EXPECT_GT(with_tangents, found.size() / 3);
  EXPECT_GT(with_lift, found.size() / 3);
  EXPECT_LE(flat_maps, found.size() / 100);
}

struct GivenRay {
  glm::dvec3 origin;
  glm::dvec3 direction;
  double reach = 0.0;
  std::uint32_t meets_backs = 0;
  std::uint32_t padding = 0;
};

TEST_F(GpuSurfacesTest, RaysMeetWhatEmbreesDo) {
  const Scene scene = many_kinds();
  const RaySpace space(scene);
  const RayScene by_embree(scene, space, 2);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> coordinate(-3.0, 3.0);
  std::vector<GivenRay> rays(100'000);
  RayBatch batch;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    rays[i].origin = {coordinate(random), 0.4 * coordinate(random) + 0.3, coordinate(random)};
    rays[i].direction = random_direction(random);
    rays[i].reach = i % 3 == 0 ? 1.5 : kInfinity;
    rays[i].meets_backs = i % 2;
    batch.push(space.from_world(rays[i].origin), rays[i].direction, rays[i].reach * space.scale,
               i % 2 == 0 ? Faces::Front : Faces::Both);
  }
  std::vector<std::uint32_t> met(rays.size());
  std::vector<std::uint8_t> blocked(rays.size());
  (void)by_embree.closest(batch, met);
  (void)by_embree.occluded(batch, blocked);
  const GpuScene placed(device(), scene, std::array{SurfaceRange{0, scene.triangles}}, 2);
  const auto found = test::map_on_gpu<std::array<std::uint32_t, 2>>(device(), traced_rays,
                                                                    std::span<const GivenRay>(rays), placed.address());
  std::size_t hits = 0;
  std::size_t misses = 0;
  std::size_t others = 0;
  std::size_t other_shadows = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    (met[i] == kNoSurface ? misses : hits) += 1;
    others += found[i][0] != met[i] ? 1U : 0U;
    // Embree's shadow rays meet both sides.
    if (rays[i].meets_backs != 0) other_shadows += (found[i][1] != 0) != (blocked[i] != 0) ? 1U : 0U;
    ASSERT_EQ(found[i][1] != 0, found[i][0] != kNoSurface) << i;
  }
  EXPECT_GT(hits, rays.size() / 4);
  EXPECT_GT(misses, rays.size() / 10);
  EXPECT_LE(others, 20U);
  EXPECT_LE(other_shadows, 10U);
}

}  // namespace
}  // namespace hpr
