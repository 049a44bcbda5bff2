#include "gpu/light/gpu_materials.h"

#include <hpr/shaders/material_points.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "gpu/device/test_kernels.h"
#include "gpu/light/test_scenes.h"
#include "rt/materials/material_point.h"
#include "rt/materials/medium.h"

namespace hpr {
namespace {

using GpuMaterialsTest = test::OnGpu;

/// As material_points.comp reads them.
struct MaterialUse {
  test::PlainSurface surface;
  glm::dvec3 direction{0.0};
  glm::dvec3 throughput{0.0};
  Media media;
  double u = 0.0;
  double metres = 0.0;
};

/// As material_points.comp writes them.
struct FoundPoint {
  glm::dvec3 base_color;
  double metallic;
  double roughness;
  double transmission;
  double ior;
  glm::dvec3 emission;
  double alpha;
  double occlusion;
  glm::dvec3 absorption;
  glm::dvec3 normal;
  double ior_spread;
  std::uint32_t unlit;
  std::uint32_t solid;
  std::uint32_t disperses;
  std::uint32_t extended;
  double specular;
  glm::dvec3 specular_color;
  double clearcoat;
  double clearcoat_roughness;
  glm::dvec3 clearcoat_normal;
  glm::dvec3 sheen_color;
  double sheen_roughness;
  double anisotropy;
  glm::dvec3 anisotropy_direction;
  double iridescence;
  double iridescence_ior;
  double iridescence_nm;
  double diffuse_transmission;
  glm::dvec3 diffuse_transmission_color;
  double alpha_alone;
  glm::dvec3 normal_alone;
  glm::dvec3 coat_normal_alone;
  double chosen_ior;
  std::uint32_t chosen_channel;
  float chosen_scale;
  glm::dvec3 to_point;
  Media towards;
  glm::dvec3 to_light;
  std::uint32_t leads_in;
  std::uint32_t carries;
};

/// How two results differ: relative to what is expected, or to 1e-3 where that is less.
class Difference {
 public:
  void add(double found, double expected) {
    if (found == expected) return;
    const double error = std::abs(found - expected) / std::max(std::abs(expected), 1e-3);
    largest_ = error <= largest_ ? largest_ : error;  // NaN counts
  }
  void add(const glm::dvec3& found, const glm::dvec3& expected) {
    for (int c = 0; c < 3; ++c) add(found[c], expected[c]);
  }
  [[nodiscard]] double largest() const { return largest_; }

 private:
  double largest_ = 0.0;
};

void compare(const FoundPoint& found, const MaterialPoint& expected, Difference& difference) {
  difference.add(found.base_color, expected.base_color);
  difference.add(found.metallic, expected.metallic);
  difference.add(found.roughness, expected.roughness);
  difference.add(found.transmission, expected.transmission);
  difference.add(found.ior, expected.ior);
  difference.add(found.emission, expected.emission);
  difference.add(found.alpha, expected.alpha);
  difference.add(found.occlusion, expected.occlusion);
  difference.add(found.absorption, expected.absorption);
  difference.add(found.normal, expected.normal);
  difference.add(found.ior_spread, expected.ior_spread);
  EXPECT_EQ(found.unlit != 0, expected.unlit);
  EXPECT_EQ(found.solid != 0, expected.solid);
  EXPECT_EQ(found.disperses != 0, disperses(expected));
  EXPECT_EQ(found.extended != 0, expected.extensions != nullptr);
}

void compare(const FoundPoint& found, const ExtensionPoint& expected, Difference& difference) {
  difference.add(found.specular, expected.specular);
  difference.add(found.specular_color, expected.specular_color);
  difference.add(found.clearcoat, expected.clearcoat);
  difference.add(found.clearcoat_roughness, expected.clearcoat_roughness);
  difference.add(found.clearcoat_normal, expected.clearcoat_normal);
  difference.add(found.sheen_color, expected.sheen_color);
  difference.add(found.sheen_roughness, expected.sheen_roughness);
  difference.add(found.anisotropy, expected.anisotropy);
  difference.add(found.anisotropy_direction, expected.anisotropy_direction);
  difference.add(found.iridescence, expected.iridescence);
  difference.add(found.iridescence_ior, expected.iridescence_ior);
  difference.add(found.iridescence_nm, expected.iridescence_nm);
  difference.add(found.diffuse_transmission, expected.diffuse_transmission);
  difference.add(found.diffuse_transmission_color, expected.diffuse_transmission_color);
}

Scene random_scene(test::Random& random) {
  Scene scene;
  scene.textures = test::random_textures(random);
  for (int i = 0; i < 500; ++i) scene.materials.push_back(test::random_material(random, scene.textures.size()));
  return scene;
}

std::vector<MaterialUse> random_uses(test::Random& random, std::size_t materials) {
  std::vector<MaterialUse> uses(100'000);
  for (MaterialUse& use : uses) {
    use.surface = test::random_surface(random, materials);
    use.direction = random.direction();
    for (int c = 0; c < 3; ++c) use.throughput[c] = random.chance(0.2) ? 0.0 : random.number();
    if (random.chance(0.6)) use.media.here = 3.0 * glm::abs(random.direction());
    if (random.chance(0.6)) use.media.around = 3.0 * glm::abs(random.direction());
    use.u = random.chance(0.1) ? 1.0 - 0x1p-53 : random.number();
    use.metres = random.chance(0.1) ? std::numeric_limits<double>::infinity() : std::exp(random.between(-9.0, 9.0));
  }
  return uses;
}

TEST_F(GpuMaterialsTest, AreWhatTheCpuMakesOfThem) {
  test::Random random(12);
  const Scene scene = random_scene(random);
  const GpuMaterials uploaded(device(), scene);
  const std::vector<MaterialUse> uses = random_uses(random, scene.materials.size());
  const auto found =
      test::map_on_gpu<FoundPoint>(device(), material_points, std::span<const MaterialUse>(uses), uploaded.address());
  std::size_t extended = 0;
  std::size_t mapped = 0;
  std::size_t partial = 0;
  for (std::size_t i = 0; i < uses.size(); ++i) {
    const MaterialUse& use = uses[i];
    const SurfacePoint surface = use.surface.surface();
    const Material& material = scene.materials[surface.material];
    MaterialPoint expected = evaluate_material(scene, surface);
    Difference difference;
    compare(found[i], expected, difference);
    compare(found[i], expected.extensions ? *expected.extensions : ExtensionPoint(), difference);
    difference.add(found[i].alpha_alone, evaluate_alpha(scene, material, surface.uv, surface.color.a));
    difference.add(found[i].normal_alone, normal_to_shade_with(scene, surface));
    difference.add(found[i].coat_normal_alone, coat_normal_to_shade_with(scene, surface));
    difference.add(found[i].to_point, transmittance_to(use.media, surface, expected, std::min(use.metres, 1e9)));
    difference.add(found[i].to_light, transmittance_to_light(use.media, surface, expected, use.direction, use.metres));
    const Media towards = media_towards(use.media, surface, expected, use.direction);
    difference.add(found[i].towards.here, towards.here);
    difference.add(found[i].towards.around, towards.around);
    EXPECT_EQ(found[i].leads_in != 0, leads_into_solid(surface, expected, use.direction));
    EXPECT_EQ(found[i].carries != 0, carries_channels(use.throughput));
    choose_channel(expected, use.throughput, use.u);
    difference.add(found[i].chosen_ior, expected.ior);
    difference.add(found[i].chosen_scale, expected.channel_scale);
    EXPECT_EQ(found[i].chosen_channel, expected.channel);
    ASSERT_LE(difference.largest(), 1e-12) << i;
    if (expected.extensions) ++extended;
    if (expected.normal != surface.facing_normal()) ++mapped;
    if (expected.alpha > 0.0 && expected.alpha < 1.0) ++partial;
  }
  EXPECT_GT(extended, uses.size() / 4);
  EXPECT_GT(mapped, uses.size() / 20);
  EXPECT_GT(partial, uses.size() / 10);
}

}  // namespace
}  // namespace hpr
