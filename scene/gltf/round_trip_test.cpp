// What encode_glb writes, load_gltf reads back as the same scene.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>

#include "scene/generators/generators.h"
#include "scene/gltf/gltf.h"
#include "scene/gltf/test_tools.h"
#include "scene/scene_test_tools.h"

namespace hpr {
namespace {

Scene written_and_loaded(const Scene& scene) {
  const test::TemporaryFolder folder;
  const std::vector<std::byte> file = encode_glb(scene);
  return load_gltf(folder.write("scene.glb", {reinterpret_cast<const char*>(file.data()), file.size()}), {}).scene;
}

/// Colours are written as a colour of at most 1 and a strength; their product may round once more.
void expect_near(const glm::vec3& a, const glm::vec3& b) {
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(a[axis], b[axis], 2e-7F * std::abs(b[axis]));
}

void expect_same(const TextureRef& a, const TextureRef& b) {
  EXPECT_EQ(a.texture, b.texture);
  if (!b.present()) return;
  EXPECT_EQ(a.uv_set, b.uv_set);
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(a.transform[i], b.transform[i], 1e-6F) << i;
}

void expect_same(const Material& a, const Material& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.base_color, b.base_color);
  EXPECT_EQ(a.metallic, b.metallic);
  EXPECT_EQ(a.roughness, b.roughness);
  expect_near(a.emissive, b.emissive);
  EXPECT_EQ(a.normal_scale, b.normal_scale);
  EXPECT_EQ(a.occlusion_strength, b.occlusion_strength);
  EXPECT_EQ(a.transmission, b.transmission);
  EXPECT_EQ(a.ior, b.ior);
  EXPECT_EQ(a.thickness, b.thickness);
  EXPECT_EQ(a.attenuation_color, b.attenuation_color);
  EXPECT_EQ(a.attenuation_distance, b.attenuation_distance);
  EXPECT_EQ(a.unlit, b.unlit);
  EXPECT_EQ(a.alpha_mode, b.alpha_mode);
  EXPECT_EQ(a.alpha_cutoff, b.alpha_cutoff);
  EXPECT_EQ(a.double_sided, b.double_sided);
  expect_same(a.base_color_texture, b.base_color_texture);
  expect_same(a.metallic_roughness_texture, b.metallic_roughness_texture);
  expect_same(a.emissive_texture, b.emissive_texture);
  expect_same(a.normal_texture, b.normal_texture);
  expect_same(a.occlusion_texture, b.occlusion_texture);
  expect_same(a.transmission_texture, b.transmission_texture);
  ASSERT_EQ(a.extensions != nullptr, b.extensions != nullptr);
  if (!a.extensions) return;
  EXPECT_EQ(*a.extensions, *b.extensions);
}

void expect_same(const Light& a, const Light& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.type, b.type);
  expect_near(a.intensity, b.intensity);
  EXPECT_EQ(a.range, b.range);
  EXPECT_EQ(a.radius, b.radius);
  EXPECT_EQ(a.angular_radius_radians, b.angular_radius_radians);
  if (b.type != LightType::Directional) {
    EXPECT_EQ(a.position, b.position);
  }
  if (b.type != LightType::Point) {
    EXPECT_LT(glm::distance(a.direction, b.direction), 1e-6F);
  }
  if (b.type == LightType::Spot) {
    EXPECT_EQ(a.inner_cone_radians, b.inner_cone_radians);
    EXPECT_EQ(a.outer_cone_radians, b.outer_cone_radians);
  }
}

void expect_same(const Camera& a, const Camera& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.eye, b.eye);
  for (int axis = 0; axis < 3; ++axis) EXPECT_LT(glm::distance(a.axes[axis], b.axes[axis]), 1e-15);
  ASSERT_EQ(a.lens.index(), b.lens.index());
  if (const auto* const lens = std::get_if<PerspectiveLens>(&b.lens)) {
    EXPECT_EQ(std::get<PerspectiveLens>(a.lens).vertical_fov_radians, lens->vertical_fov_radians);
    return;
  }
  const auto& lens = std::get<OrthographicLens>(a.lens);
  EXPECT_EQ(lens.half_width, std::get<OrthographicLens>(b.lens).half_width);
  EXPECT_EQ(lens.half_height, std::get<OrthographicLens>(b.lens).half_height);
  EXPECT_EQ(lens.near_distance, std::get<OrthographicLens>(b.lens).near_distance);
  EXPECT_EQ(lens.far_distance, std::get<OrthographicLens>(b.lens).far_distance);
}

void expect_same(const Scene& a, const Scene& b) {
  EXPECT_EQ(a.warnings, std::vector<std::string>{});
  EXPECT_EQ(a.triangles, b.triangles);
  EXPECT_EQ(a.bounds.low, b.bounds.low);
  EXPECT_EQ(a.bounds.high, b.bounds.high);
  ASSERT_EQ(a.instances.size(), b.instances.size());
  for (std::size_t i = 0; i < b.instances.size(); ++i) {
    ASSERT_EQ(a.instances[i].to_world, b.instances[i].to_world) << i;
    ASSERT_EQ(a.instances[i].first_surface, b.instances[i].first_surface) << i;
    const Mesh& mesh = b.mesh_of(b.instances[i]);
    const Mesh& read = a.mesh_of(a.instances[i]);
    ASSERT_TRUE(read.positions == mesh.positions && read.normals == mesh.normals && read.uvs == mesh.uvs &&
                read.colors == mesh.colors && read.tangents == mesh.tangents && read.triangles == mesh.triangles)
        << i;
    ASSERT_EQ(read.kind, mesh.kind) << i;
    ASSERT_EQ(read.material, mesh.material) << i;
  }
  ASSERT_EQ(a.textures.size(), b.textures.size());
  for (std::size_t i = 0; i < b.textures.size(); ++i) {
    EXPECT_TRUE(a.textures[i].image == b.textures[i].image) << i;
    EXPECT_EQ(a.textures[i].wrap_s, b.textures[i].wrap_s) << i;
    EXPECT_EQ(a.textures[i].wrap_t, b.textures[i].wrap_t) << i;
    EXPECT_EQ(a.textures[i].nearest, b.textures[i].nearest) << i;
  }
  ASSERT_EQ(a.materials.size(), b.materials.size());
  for (std::size_t i = 0; i < b.materials.size(); ++i) expect_same(a.materials[i], b.materials[i]);
  ASSERT_EQ(a.lights.size(), b.lights.size());
  for (std::size_t i = 0; i < b.lights.size(); ++i) expect_same(a.lights[i], b.lights[i]);
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  for (std::size_t i = 0; i < b.cameras.size(); ++i) expect_same(a.cameras[i], b.cameras[i]);
}

TEST(GltfRoundTrip, EveryGeneratedSceneComesBack) {
  for (const char* name :
       {"gallery?s=1&k=1&n=2&cases=2", "sphereflake?s=2&n=2", "tetra?s=4", "tetra?s=9", "cornell?variant=glass",
        "cornell?variant=mirror&lamp=coplanar", "asteroids?k=1&count=60", "cloud?count=50"}) {
    SCOPED_TRACE(name);
    const Scene scene = generate_scene(name);
    expect_same(written_and_loaded(scene), scene);
  }
}

TEST(GltfRoundTrip, WhatNoGeneratorMakesComesBackToo) {
  Scene scene = generate_scene("cornell");
  Texture texture;
  Image<Rgba8> image({2, 1}, {1, 2, 3, 4});
  image.at(1, 0) = {250, 100, 50, 255};
  texture.image = std::move(image);
  texture.wrap_s = Wrap::ClampToEdge;
  texture.wrap_t = Wrap::MirroredRepeat;
  scene.textures = {texture, texture};
  scene.textures[1].nearest = true;
  Material& material = scene.materials[0];
  material.alpha_mode = AlphaMode::Mask;
  material.alpha_cutoff = 0.25F;
  material.double_sided = true;
  material.base_color_texture = {0, 0, {0.0F, -2.0F, 3.0F, 0.0F, 0.25F, 0.5F}};
  material.metallic_roughness_texture = {1, 0, TextureRef{}.transform};
  material.emissive_texture = {1, 0, TextureRef{}.transform};
  material.emissive = {0.1F, 0.7F, 30.3F};
  material.normal_texture = {0, 0, {2.0F, 0.0F, 0.0F, 3.0F, 0.25F, 0.5F}};
  material.normal_scale = -0.3F;
  material.occlusion_texture = {1, 0, TextureRef{}.transform};
  material.occlusion_strength = 0.7F;
  material.transmission = 0.6F;
  material.transmission_texture = {0, 0, {0.0F, -2.0F, 3.0F, 0.0F, 0.25F, 0.5F}};
  material.ior = 1.7F;
  material.thickness = 0.1F;
  material.attenuation_color = {0.1F, 0.9F, 1.0F};
  material.attenuation_distance = 0.3F;
  material.unlit = true;
  Material& extended = scene.materials.emplace_back();
  extended.name = "extended";
  extended.double_sided = false;
  extended.extensions = std::make_shared<const MaterialExtensions>(test::full_extensions());
  for (Mesh& mesh : scene.meshes) {
    mesh.uvs[0].assign(mesh.positions.size(), {0.5F, 0.25F});
    mesh.colors.assign(mesh.positions.size(), {0.1F, 0.2F, 0.3F, 0.4F});
    mesh.tangents.assign(mesh.positions.size(), {0.6F, 0.0F, 0.8F, -1.0F});
  }
  Light spot;
  spot.name = "spot";
  spot.type = LightType::Spot;
  spot.position = {0.1, 0.2, 1e5 / 3.0};
  spot.direction = glm::normalize(glm::vec3(0.3F, -0.9F, 0.2F));
  spot.intensity = {0.1F, 7.0F, 3.0F};
  spot.range = 12.5;
  spot.inner_cone_radians = 0.3F;
  spot.outer_cone_radians = 0.6F;
  Light sun = spot;
  sun.name = "sun";
  sun.type = LightType::Directional;
  sun.direction = {0.0F, 1.0F, 0.0F};
  sun.range = 0.0;
  sun.angular_radius_radians = 0.00465F;
  Light bulb = spot;
  bulb.name = "bulb";
  bulb.type = LightType::Point;
  bulb.radius = 0.03;
  scene.lights = {spot, sun, bulb};
  Camera flat = scene.cameras[0];
  flat.name = "flat";
  flat.lens = OrthographicLens{3.0, 2.0, 0.5, 77.0};
  scene.cameras.push_back(flat);
  expect_same(written_and_loaded(scene), scene);
}

}  // namespace
}  // namespace hpr
