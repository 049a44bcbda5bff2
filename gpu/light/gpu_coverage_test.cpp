#include <hpr/shaders/covered_rays.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <span>
#include <vector>

#include "gpu/device/test_kernels.h"
#include "gpu/gpu_scene.h"
#include "gpu/light/gpu_materials.h"
#include "gpu/light/gpu_surfaces.h"
#include "gpu/light/test_scenes.h"
#include "rt/test_scene.h"
#include "rt/trace/coverage_traversal.h"

// Rays through surfaces of partial coverage: gpu/shaders/coverage.glsl against rt/trace/coverage_traversal.h.
namespace hpr {
namespace {

using GpuCoverageTest = test::OnGpu;
using test::add_material;
using test::add_mesh;
using test::place_mesh;
using test::quad;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::uint32_t add_veil(Scene& scene, AlphaMode mode, float alpha, std::int32_t texture = -1, bool double_sided = true) {
  Material material = test::diffuse();
  material.alpha_mode = mode;
  material.base_color.a = alpha;
  material.base_color_texture.texture = texture;
  material.double_sided = double_sided;
  return add_material(scene, material);
}

/// Of all alphas, in nearest texels.
void add_texture(Scene& scene, test::Random& random) {
  Image<Rgba8> image({8, 8});
  for (int i = 0; i < 64; ++i) {
    const auto level = static_cast<std::uint8_t>(random.chance(0.3) ? 0 : random.chance(0.3) ? 255 : random.below(256));
    image.at(i % 8, i / 8) = {200, 100, 50, level};
  }
  scene.textures.emplace_back().image = std::move(image);
  scene.textures.back().nearest = true;
}

/// Panes in layers and in one plane, balls seen from both sides, mirrored and stretched, and opaque ones among them.
Scene layered(test::Random& random) {
  Scene scene;
  add_texture(scene, random);
  std::vector<std::uint32_t> veils;
  for (const float alpha : {0.0F, 0.1F, 0.5F, 0.9F, 1.0F}) veils.push_back(add_veil(scene, AlphaMode::Blend, alpha));
  veils.push_back(add_veil(scene, AlphaMode::Blend, 0.8F, 0));
  veils.push_back(add_veil(scene, AlphaMode::Mask, 1.0F, 0));
  veils.push_back(add_veil(scene, AlphaMode::Mask, 0.7F, 0, false));
  veils.push_back(add_veil(scene, AlphaMode::Blend, 0.4F, -1, false));
  const std::uint32_t solid = add_material(scene, test::diffuse());
  for (std::size_t i = 0; i < 40; ++i) {
    const glm::vec3 corner(random.between(-3, 1), random.between(-3, 1), random.between(-3, 3));
    const glm::vec3 across(random.between(1, 3), random.between(-0.5, 0.5), random.between(-0.5, 0.5));
    const glm::vec3 along(random.between(-0.5, 0.5), random.between(1, 3), random.between(-0.5, 0.5));
    Mesh pane = quad(corner, across, along, veils[i % veils.size()]);
    if (random.chance(0.3)) {
      for (int vertex = 0; vertex < 4; ++vertex) pane.colors.emplace_back(1.0F, 1.0F, 1.0F, random.factor());
    }
    place_mesh(scene, add_mesh(scene, pane));
  }
  // In one slanted plane, but for rounding, the last of them opaque.
  const glm::dvec3 right = glm::normalize(glm::dvec3(1.0, 0.3, -0.2));
  const glm::dvec3 up = glm::normalize(glm::cross(glm::dvec3(0.1, -0.2, 1.0), right));
  for (std::size_t i = 0; i < 12; ++i) {
    const glm::dvec3 corner = random.between(-3, 0) * right + random.between(-3, 0) * up;
    place_mesh(scene, add_mesh(scene, quad(corner, 2.5 * right, 2.5 * up, i == 11 ? solid : veils[1 + i % 8])));
  }
  const std::array<std::uint32_t, 3> balls{add_mesh(scene, test::sphere(0.6, 7, veils[2])),
                                           add_mesh(scene, test::sphere(0.5, 6, veils[8])),
                                           add_mesh(scene, test::sphere(0.4, 6, solid))};
  for (std::size_t i = 0; i < 18; ++i) {
    const glm::dvec3 where(random.between(-3, 3), random.between(-3, 3), random.between(-3, 3));
    const glm::dmat4 there =
        glm::rotate(glm::translate(glm::dmat4(1.0), where), random.between(0, 6), random.direction());
    place_mesh(scene, balls.at(i % 3),
               glm::scale(there, glm::dvec3(i % 2 == 0 ? 1.0 : -1.0, random.between(0.5, 1.5), 1.0)));
  }
  finish_scene(scene);
  return scene;
}

constexpr std::size_t kPanes = 40;  ///< of layered(): its first instances, of two triangles each, each in its own plane

/// On the edge between a pane's triangles.
glm::dvec3 on_diagonal(const Scene& scene, test::Random& random) {
  const Mesh& pane = scene.mesh_of(scene.instances[random.below(kPanes)]);
  return glm::mix(glm::dvec3(pane.positions[0]), glm::dvec3(pane.positions[2]), random.number());
}

/// Whether a ray that meets the edge between both may meet either.
bool are_of_one_pane(std::uint32_t a, std::uint32_t b) {
  return a / 2 == b / 2 && a < 2 * kPanes;
}

/// As covered_rays.comp reads and writes them.
struct SentRay {
  glm::dvec3 origin{0.0};
  glm::dvec3 direction{0.0};
  double reach = 0.0;
  std::uint64_t stream = 0;
  std::uint32_t meets_backs = 0;
  std::uint32_t is_shadow = 0;  ///< asks what gets through, not what it meets
};
struct Outcome {
  double passed;
  std::uint32_t surface;
  std::uint32_t draw;
  std::uint32_t cut;
  std::uint32_t is_unfinished;
};

/// Of a scene, both by the CPU and on a device.
class Traced {
 public:
  Traced(const GpuDevice& device, const Scene& scene, const std::vector<SentRay>& rays)
      : expected(rays.size()), draws(rays.size()), passed(rays.size()) {
    const RaySpace space(scene);
    const Surfaces surfaces(scene, space);
    const auto with_alpha = covering_surfaces(scene, true);
    const RayScene opaque(scene, space, 2, covering_surfaces(scene, false));
    const RayScene alpha_tested(scene, space, 2, with_alpha);
    const CoverageTraversal traversal(scene, surfaces, space, opaque, &alpha_tested);
    std::vector<Sampler> samplers;
    std::vector<RayRequest> requests;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      samplers.emplace_back(rays[i].stream, static_cast<std::uint32_t>(i));
    }
    for (std::size_t i = 0; i < rays.size(); ++i) {
      requests.push_back({rays[i].origin, rays[i].direction, rays[i].reach, &samplers[i], 0,
                          rays[i].meets_backs != 0 ? Faces::Both : Faces::Front});
    }
    const auto of_kind = [&](bool is_shadow) {
      std::vector<RayRequest> asked = requests;
      for (std::size_t i = 0; i < rays.size(); ++i) {
        if ((rays[i].is_shadow != 0) != is_shadow) asked[i].reach = 0.0;
      }
      return asked;
    };
    TraversalScratch scratch;
    (void)traversal.closest(of_kind(false), expected, scratch);
    (void)traversal.passed(of_kind(true), passed, scratch);
    cut = scratch.cut;
    for (std::size_t i = 0; i < rays.size(); ++i) draws[i] = static_cast<std::uint32_t>(0x1p32 * samplers[i].one());

    const GpuScene opaque_there(device, scene, covering_surfaces(scene, false), 2);
    const GpuScene alpha_there(device, scene, with_alpha, 2);
    const GpuSurfaces surfaces_there(device, scene, surfaces);
    const GpuMaterials materials(device, scene);
    found = test::map_on_gpu<Outcome>(device, covered_rays, std::span(rays), opaque_there.address(),
                                      alpha_there.address(), surfaces_there.address(), materials.address());
  }

  std::vector<std::uint32_t> expected;
  std::vector<std::uint32_t> draws;
  std::vector<float> passed;
  std::uint64_t cut = 0;
  std::vector<Outcome> found;
};

TEST_F(GpuCoverageTest, RaysPassWhatTheCpusPass) {
  test::Random random(11);
  const Scene scene = layered(random);
  std::vector<SentRay> rays(100'000);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    rays[i].origin = {random.between(-4, 4), random.between(-4, 4), random.between(-4, 4)};
    rays[i].direction = random.direction();
    if (i % 8 < 2) rays[i].direction = glm::normalize(on_diagonal(scene, random) - rays[i].origin);
    rays[i].reach = i % 3 == 0 ? random.between(0.5, 6.0) : kInfinity;
    rays[i].stream = 77 + i;
    rays[i].is_shadow = i % 2;
    rays[i].meets_backs = i / 2 % 2;
  }
  const Traced traced(device(), scene, rays);
  std::size_t others = 0;
  std::size_t partly = 0;
  std::size_t drew = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Outcome& found = traced.found[i];
    ASSERT_EQ(found.is_unfinished, 0U) << i;
    const bool is_met = found.surface == traced.expected[i] || are_of_one_pane(found.surface, traced.expected[i]);
    const bool same = is_met && found.draw == traced.draws[i] &&
                      std::abs(found.passed - static_cast<double>(traced.passed[i])) <= 1e-6;
    others += same ? 0U : 1U;
    partly += traced.passed[i] > 0.0F && traced.passed[i] < 1.0F ? 1U : 0U;
    Sampler fresh(rays[i].stream, static_cast<std::uint32_t>(i));
    drew += static_cast<std::uint32_t>(0x1p32 * fresh.one()) != traced.draws[i] ? 1U : 0U;
  }
  EXPECT_LE(others, 10U);  // edges
  EXPECT_GT(partly, rays.size() / 20);
  EXPECT_GT(drew, rays.size() / 10);
}

/// Many layers of next to nothing: a ray ends among them, and is counted.
TEST_F(GpuCoverageTest, RaysEndAmongTooManyLayers) {
  Scene scene;
  const std::uint32_t thin = add_veil(scene, AlphaMode::Blend, 1e-4F);
  Mesh panes;
  panes.material = thin;
  for (std::uint32_t i = 0; i < kMaxPassed + 20; ++i) {
    const float z = 0.01F * static_cast<float>(i);
    panes.positions.insert(panes.positions.end(), {{-1, -1, z}, {1, -1, z}, {1, 1, z}});
    panes.triangles.emplace_back(3 * i, 3 * i + 1, 3 * i + 2);
  }
  place_mesh(scene, add_mesh(scene, panes));
  place_mesh(scene, add_mesh(scene, quad({-1, -1, 20}, {2, 0, 0}, {0, 2, 0}, add_material(scene, test::diffuse()))));
  finish_scene(scene);
  std::vector<SentRay> rays;  // eight of a kind: software devices count the loops of so many together
  for (std::uint32_t i = 0; i < 16; ++i)
    rays.push_back({{0.04 * static_cast<double>(i) + 0.3, 0.1, -1.0}, {0, 0, 1}, 15.0, 5, 1, i / 8U});
  const Traced traced(device(), scene, rays);
  std::uint64_t cut = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    EXPECT_EQ(traced.found[i].surface, traced.expected[i]);
    EXPECT_NEAR(traced.found[i].passed, static_cast<double>(traced.passed[i]), 1e-6);
    cut += traced.found[i].cut;
  }
  EXPECT_GT(cut, 0U);
  EXPECT_EQ(cut, traced.cut);
}

/// More in one plane than a thread has room for.
TEST_F(GpuCoverageTest, SaysWhatItCannotFinish) {
  Scene scene;
  const std::uint32_t half = add_veil(scene, AlphaMode::Blend, 0.5F);
  for (int i = 0; i < 13; ++i) place_mesh(scene, add_mesh(scene, quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, half)));
  place_mesh(scene, add_mesh(scene, quad({-1, -1, 2}, {2, 0, 0}, {0, 2, 0}, add_material(scene, test::diffuse()))));
  finish_scene(scene);
  const std::vector<SentRay> rays{{{0.3, 0.1, -1.0}, {0, 0, 1}, 1.5, 5, 1, 0}};
  const Traced traced(device(), scene, rays);
  EXPECT_EQ(traced.found[0].is_unfinished, 1U);
}

}  // namespace
}  // namespace hpr
