#include "rt/materials/material_point.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <memory>

#include "rt/test_scene.h"

namespace hpr {
namespace {

/// A scene of one material and textures of one texel each.
Scene scene_with(const Material& material, const std::vector<Rgba8>& texels = {}) {
  Scene scene;
  scene.materials = {material};
  for (const Rgba8& texel : texels) scene.textures.emplace_back().image = Image<Rgba8>({1, 1}, texel);
  return scene;
}

SurfacePoint plain_surface() {
  SurfacePoint surface;
  surface.to_viewer = surface.geometric_normal = surface.shading_normal = {0.0, 0.0, 1.0};
  return surface;
}

MaterialPoint evaluate(const Material& material, const std::vector<Rgba8>& texels = {},
                       const SurfacePoint& surface = plain_surface()) {
  return evaluate_material(scene_with(material, texels), surface);
}

TEST(MaterialPoint, ReadsRoughnessFromGreenMetalFromBlueAndColourFromSrgb) {
  Material material;
  material.base_color_texture.texture = 0;
  material.metallic_roughness_texture.texture = 1;
  material.emissive = glm::vec3(4.0F);
  material.emissive_texture.texture = 0;
  const MaterialPoint point = evaluate(material, {{188, 188, 188, 255}, {7, 51, 255, 255}});
  EXPECT_NEAR(point.base_color.r, 0.5029, 1e-3);
  EXPECT_NEAR(point.roughness, 0.2, 1e-12);
  EXPECT_NEAR(point.metallic, 1.0, 1e-12);
  EXPECT_NEAR(point.emission.g, 4.0 * 0.5029, 4e-3);
}

TEST(MaterialPoint, VertexColorsAreAFactor) {
  Material material;
  material.base_color = {0.5F, 1.0F, 1.0F, 0.5F};
  material.alpha_mode = AlphaMode::Blend;
  SurfacePoint surface = plain_surface();
  surface.color = {0.5, 0.25, 1.0, 0.5};
  const MaterialPoint point = evaluate(material, {}, surface);
  EXPECT_EQ(point.base_color, glm::dvec3(0.25, 0.25, 1.0));
  EXPECT_EQ(point.alpha, 0.25);
}

TEST(MaterialPoint, CoverageGoesByTheModeOfAlpha) {
  Material material;
  material.base_color.a = 0.5F;
  material.base_color_texture.texture = 0;
  const std::vector<Rgba8> half{{255, 255, 255, 51}};  // 0.2
  const auto coverage = [&](AlphaMode mode, float cutoff, double color_alpha) {
    material.alpha_mode = mode;
    material.alpha_cutoff = cutoff;
    SurfacePoint surface = plain_surface();
    surface.color.a = color_alpha;
    const double alpha = evaluate(material, half, surface).alpha;
    EXPECT_EQ(evaluate_alpha(scene_with(material, half), material, {}, color_alpha), alpha);
    return alpha;
  };
  EXPECT_EQ(coverage(AlphaMode::Opaque, 0.5F, 0.0), 1.0);
  EXPECT_NEAR(coverage(AlphaMode::Blend, 0.5F, 0.5), 0.05, 1e-12);
  EXPECT_EQ(coverage(AlphaMode::Mask, 0.11F, 1.0), 0.0);
  EXPECT_EQ(coverage(AlphaMode::Mask, 0.09F, 1.0), 1.0);
  EXPECT_EQ(coverage(AlphaMode::Mask, 0.0F, 0.0), 1.0) << "alpha at the cutoff is covered";
  material.base_color_texture.texture = -1;
  EXPECT_EQ(coverage(AlphaMode::Mask, 0.5F, 1.0), 1.0);
  EXPECT_EQ(coverage(AlphaMode::Mask, 0.5F, 1.0 - 0x1p-53), 1.0) << "as far as the cutoff's digits go";
  material.base_color.a = 1.0F;
  material.base_color_texture.texture = 0;
  EXPECT_EQ(coverage(AlphaMode::Mask, 51.0F / 255.0F, 1.0), 1.0);
}

TEST(MaterialPoint, OcclusionIsHeldBackByItsStrength) {
  Material material;
  material.occlusion_texture.texture = 0;
  EXPECT_NEAR(evaluate(material, {{51, 255, 255, 255}}).occlusion, 0.2, 1e-12);
  material.occlusion_strength = 0.5F;
  EXPECT_NEAR(evaluate(material, {{51, 255, 255, 255}}).occlusion, 0.6, 1e-12);
  EXPECT_EQ(evaluate(Material{}).occlusion, 1.0);
}

TEST(MaterialPoint, UnlitMaterialsEmitTheirBaseColor) {
  Material material;
  material.unlit = true;
  material.base_color = {0.25F, 0.5F, 1.0F, 1.0F};
  material.emissive = glm::vec3(7.0F);
  const MaterialPoint point = evaluate(material);
  EXPECT_TRUE(point.unlit);
  EXPECT_EQ(point.emission, glm::dvec3(0.25, 0.5, 1.0));
}

TEST(MaterialPoint, ACoatDimsWhatEmitsBelowIt) {
  Material material;
  material.emissive = {1.0F, 2.0F, 4.0F};
  MaterialExtensions extensions;
  extensions.clearcoat = 0.5F;
  material.extensions = std::make_shared<const MaterialExtensions>(extensions);
  EXPECT_NEAR(evaluate(material).emission.b, 4.0 * (1.0 - 0.5 * 0.04), 1e-12);
  SurfacePoint aslant = plain_surface();
  aslant.to_viewer = {std::sqrt(0.75), 0.0, 0.5};
  const double reflected = 0.5 * (0.04 + 0.96 / 32.0);
  EXPECT_NEAR(evaluate(material, {}, aslant).emission.b, 4.0 * (1.0 - reflected), 1e-12);
  // Seen from within a solid there is no coat.
  material.transmission = material.thickness = 1.0F;
  material.double_sided = true;
  aslant.inside = true;
  EXPECT_EQ(evaluate(material, {}, aslant).emission.b, 4.0);
  aslant.inside = false;
  EXPECT_NEAR(evaluate(material, {}, aslant).emission.b, 4.0 * (1.0 - reflected), 1e-12);
}

TEST(MaterialPoint, GlassReadsItsTextureAndAbsorbsByItsVolume) {
  Material material;
  material.transmission = 0.5F;
  material.transmission_texture.texture = 0;
  material.thickness = 0.1F;
  material.attenuation_color = {0.5F, 1.0F, 0.0F};
  material.attenuation_distance = 2.0F;
  MaterialPoint point = evaluate(material, {{51, 255, 255, 255}});
  EXPECT_NEAR(point.transmission, 0.1, 1e-12);
  EXPECT_TRUE(point.solid);
  EXPECT_NEAR(std::exp(-2.0 * point.absorption.r), 0.5, 1e-12);
  EXPECT_EQ(point.absorption.g, 0.0);
  EXPECT_TRUE(std::isfinite(point.absorption.b));
  EXPECT_LT(std::exp(-2.0 * point.absorption.b), 1e-29);
  material.attenuation_distance = std::numeric_limits<float>::infinity();
  EXPECT_EQ(evaluate(material, {{51, 255, 255, 255}}).absorption, glm::dvec3(0.0));
  material.thickness = 0.0F;
  point = evaluate(material, {{51, 255, 255, 255}});
  EXPECT_FALSE(point.solid);
}

/// A quad in the plane z = 0 whose u grows along x and whose v falls along y, and a normal map that leans the normal by
/// 45 degrees to `x`, `y` of the map.
Scene mapped_quad(std::uint8_t x, std::uint8_t y, const glm::dmat4& to_world = glm::dmat4(1.0)) {
  Scene scene;
  Material material;
  material.normal_texture.texture = 0;
  scene.materials = {material};
  scene.textures.emplace_back().image = Image<Rgba8>({1, 1}, {x, y, 255, 255});
  Mesh mesh = test::quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 0);
  mesh.uvs[0] = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
  test::place_mesh(scene, test::add_mesh(scene, mesh), to_world);
  finish_scene(scene);
  return scene;
}

glm::dvec3 normal_seen(const Scene& scene, const glm::dvec3& eye, const glm::dvec3& at) {
  const Surfaces surfaces(scene, RaySpace(scene));
  WorldTriangle triangle;
  surfaces.load(0, triangle);
  return evaluate_material(scene, surfaces.meet(triangle, eye, at - eye)).normal;
}

void expect_close(const glm::dvec3& a, const glm::dvec3& b) {
  EXPECT_LT(glm::distance(a, glm::normalize(b)), 0.006) << a.x << ' ' << a.y << ' ' << a.z;
}

TEST(NormalMap, LeansRightAlongUAndUpAgainstV) {
  const glm::dvec3 at(0.6, 0.3, 0.0);
  expect_close(normal_seen(mapped_quad(255, 128), {0.6, 0.3, 2}, at), {1, 0, 1});
  expect_close(normal_seen(mapped_quad(128, 255), {0.6, 0.3, 2}, at), {0, 1, 1});
  expect_close(normal_seen(mapped_quad(128, 128), {0.6, 0.3, 2}, at), {0, 0, 1});
}

TEST(NormalMap, IsTurnedAsAWholeForViewersBehind) {
  const glm::dvec3 at(0.6, 0.3, 0.0);
  expect_close(normal_seen(mapped_quad(255, 128), {0.6, 0.3, -2}, at), {-1, 0, -1});
  expect_close(normal_seen(mapped_quad(128, 255), {0.6, 0.3, -2}, at), {0, -1, -1});
}

TEST(NormalMap, FollowsTheFilesTangents) {
  const glm::dvec3 at(0.6, 0.3, 0.0);
  Scene scene = mapped_quad(255, 128);
  scene.meshes[0].tangents.assign(4, {0, 1, 0, 1});
  expect_close(normal_seen(scene, {0.6, 0.3, 2}, at), {0, 1, 1});
  scene.textures[0].image = Image<Rgba8>({1, 1}, {128, 255, 255, 255});
  expect_close(normal_seen(scene, {0.6, 0.3, 2}, at), {-1, 0, 1});
  scene.meshes[0].tangents.assign(4, {0, 1, 0, -1});
  expect_close(normal_seen(scene, {0.6, 0.3, 2}, at), {1, 0, 1});
  scene.meshes[0].tangents.assign(4, {0, 0, 0, 1});
  expect_close(normal_seen(scene, {0.6, 0.3, 2}, at), {0, 1, 1});
}

TEST(NormalMap, IsMirroredWithItsInstance) {
  const glm::dmat4 mirror = glm::scale(glm::dmat4(1.0), {-1.0, 1.0, 1.0});
  const glm::dvec3 eye(-0.6, 0.3, 2.0);
  const glm::dvec3 at(-0.6, 0.3, 0.0);
  for (const bool tangents : {false, true}) {
    for (const bool up : {false, true}) {
      Scene scene = mapped_quad(up ? 128 : 255, up ? 255 : 128, mirror);
      if (tangents) scene.meshes[0].tangents.assign(4, {1, 0, 0, 1});
      expect_close(normal_seen(scene, eye, at), up ? glm::dvec3(0, 1, 1) : glm::dvec3(-1, 0, 1));
    }
  }
}

TEST(NormalMap, IsCarriedIntoTheWorldAsByTheFilesTangents) {
  const glm::dmat4 stretched = glm::scale(glm::dmat4(1.0), {2.0, 0.5, 1.0});
  const glm::dvec3 at(1.2, 0.15, 0.0);
  const auto c = std::cos(0.6F);
  const auto s = std::sin(0.6F);
  for (const double side : {1.0, -1.0}) {
    const glm::dvec3 eye(1.2, 0.15, 2.0 * side);
    Scene scene = mapped_quad(220, 90, stretched);
    scene.materials[0].normal_texture.transform = {c, -s, s, c, 0, 0};  // turned: neither axis is the scale's
    const glm::dvec3 derived = normal_seen(scene, eye, at);
    scene.meshes[0].tangents.assign(4, {c, -s, 0.0F, 1.0F});
    EXPECT_LT(glm::distance(derived, normal_seen(scene, eye, at)), 1e-6) << side;
  }
}

TEST(NormalMap, IsScaledAndTurnedByItsTextureTransform) {
  Scene scene = mapped_quad(255, 128);
  const glm::dvec3 at(0.6, 0.3, 0.0);
  scene.materials[0].normal_scale = -0.5F;
  expect_close(normal_seen(scene, {0.6, 0.3, 2}, at), {-0.5, 0, 1});
  scene.materials[0].normal_scale = 1.0F;
  // u' = v: the map's x points where v grows, down.
  scene.materials[0].normal_texture.transform = {0, 1, 1, 0, 0, 0};
  expect_close(normal_seen(scene, {0.6, 0.3, 2}, at), {0, -1, 1});
}

TEST(NormalMap, GivesWayWhereItTurnsFromTheViewerOrCannotBePlaced) {
  Scene scene = mapped_quad(255, 128);
  const glm::dvec3 at(0.6, 0.3, 0.0);
  expect_close(normal_seen(scene, at + glm::dvec3(-2, 0, 0.5), at), {0, 0, 1});
  scene.meshes[0].uvs[0].assign(4, {0.5F, 0.5F});
  expect_close(normal_seen(scene, {0.6, 0.3, 2}, at), {0, 0, 1});
  scene.meshes[0].uvs[0].clear();
  expect_close(normal_seen(scene, {0.6, 0.3, 2}, at), {0, 0, 1});
  scene.materials[0].normal_texture.uv_set = 1;
  expect_close(normal_seen(scene, {0.6, 0.3, 2}, at), {0, 0, 1});
}

}  // namespace
}  // namespace hpr
