#include <gtest/gtest.h>

#include <functional>
#include <map>
#include <string>

#include "scene/scene.h"
#include "scene/scene_test_tools.h"

namespace hpr {
namespace {

/// A scene in which every field has a value that is not its default.
Scene full_scene() {
  Scene scene;
  scene.name = "full";
  Mesh mesh;
  mesh.name = "mesh";
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.normals.assign(3, {0, 0, 1});
  mesh.uvs[0] = {{0, 0}, {1, 0}, {0, 1}};
  mesh.uvs[1] = {{0, 0}, {2, 0}, {0, 2}};
  mesh.colors.assign(3, {0.1F, 0.2F, 0.3F, 0.4F});
  mesh.tangents.assign(3, {1, 0, 0, -1});
  mesh.triangles = {{0, 1, 2}};
  mesh.material = 1;
  scene.meshes = {mesh, Mesh{}};
  Material material;
  material.name = "material";
  material.base_color = {0.1F, 0.2F, 0.3F, 0.4F};
  material.base_color_texture = {.texture = 0, .uv_set = 1, .transform = {2, 0, 0, 2, 0.5F, 0.5F}};
  material.metallic = 0.3F;
  material.roughness = 0.2F;
  material.metallic_roughness_texture.texture = 0;
  material.emissive = {1, 2, 3};
  material.emissive_texture.texture = 0;
  material.normal_texture.texture = 0;
  material.normal_scale = 0.6F;
  material.occlusion_texture.texture = 0;
  material.occlusion_strength = 0.7F;
  material.transmission = 0.5F;
  material.transmission_texture.texture = 0;
  material.ior = 1.3F;
  material.thickness = 0.2F;
  material.attenuation_color = {0.5F, 0.6F, 0.7F};
  material.attenuation_distance = 3.0F;
  material.alpha_mode = AlphaMode::Mask;
  material.alpha_cutoff = 0.4F;
  material.double_sided = true;
  material.unlit = true;
  material.extensions = std::make_shared<const MaterialExtensions>(test::full_extensions());
  scene.materials = {Material{}, material};
  Texture texture{.name = "texture", .image = Image<Rgba8>({2, 3}, {1, 2, 3, 4})};
  texture.wrap_s = Wrap::ClampToEdge;
  texture.wrap_t = Wrap::MirroredRepeat;
  texture.nearest = true;
  scene.textures = {texture};
  Instance instance;
  instance.to_world[3] = {1, 2, 3, 1};
  scene.instances = {instance, instance};
  scene.lights = {Light{.name = "light",
                        .type = LightType::Spot,
                        .position = {1, 2, 3},
                        .direction = {0, -1, 0},
                        .intensity = {4, 5, 6},
                        .range = 7.0,
                        .inner_cone_radians = 0.1F,
                        .outer_cone_radians = 0.2F,
                        .radius = 0.3,
                        .angular_radius_radians = 0.4F}};
  scene.cameras = {Camera{.name = "a", .eye = {1, 2, 3}, .axes = glm::dmat3(1.0), .lens = PerspectiveLens{1.0, 0.1}},
                   Camera{.name = "b", .eye = {}, .axes = glm::dmat3(1.0), .lens = OrthographicLens{1, 2, 3, 4}}};
  scene.background = {0.1F, 0.2F, 0.3F};
  scene.environment = Environment{Image<Rgb>({2, 1}, {1, 2, 3}), 0.5, 2.0};
  scene.node_names = {"chair", "table"};
  scene.warnings = {"odd"};
  finish_scene(scene);
  return scene;
}

template <typename Value>
void extend(Scene& scene, Value MaterialExtensions::*member, const Value& value) {
  MaterialExtensions extensions = *scene.materials[1].extensions;
  extensions.*member = value;
  scene.materials[1].extensions = std::make_shared<const MaterialExtensions>(extensions);
}

TEST(SceneBytes, ComeBackAsTheSameScene) {
  const Scene scene = full_scene();
  const auto bytes = to_bytes(scene);
  const Scene copy = scene_from_bytes(bytes);
  EXPECT_EQ(to_bytes(copy), bytes);
  EXPECT_EQ(content_hash(copy), content_hash(scene));
  EXPECT_EQ(copy.name, "full");
  EXPECT_EQ(copy.triangles, 2U);
  EXPECT_EQ(copy.meshes[0].triangles, scene.meshes[0].triangles);
  EXPECT_EQ(copy.meshes[0].uvs[1], scene.meshes[0].uvs[1]);
  EXPECT_EQ(copy.textures[0].image, scene.textures[0].image);
  EXPECT_EQ(copy.instances[1].to_world, scene.instances[1].to_world);
  EXPECT_EQ(copy.lights[0].type, LightType::Spot);
  EXPECT_EQ(std::get<PerspectiveLens>(copy.cameras[0].lens).near_distance, 0.1);
  EXPECT_EQ(std::get<OrthographicLens>(copy.cameras[1].lens).far_distance, 4.0);
  ASSERT_TRUE(copy.environment.has_value());
  EXPECT_EQ(copy.environment->image, scene.environment->image);
  EXPECT_EQ(copy.lights[0].radius, 0.3);
  EXPECT_FALSE(copy.materials[0].extensions);
  ASSERT_TRUE(copy.materials[1].extensions);
  EXPECT_EQ(*copy.materials[1].extensions, *scene.materials[1].extensions);
  EXPECT_EQ(copy.warnings, scene.warnings);
  EXPECT_EQ(copy.node_names, scene.node_names);
}

TEST(SceneBytes, OfAnEmptySceneComeBackToo) {
  EXPECT_EQ(content_hash(scene_from_bytes(to_bytes(Scene{}))), content_hash(Scene{}));
}

TEST(ContentHash, IsTheHashOfTheBytesAndTheSameEveryTime) {
  EXPECT_EQ(content_hash(full_scene()), content_hash(full_scene()));
}

TEST(ContentHash, ChangesWithEveryField) {
  const std::map<std::string, std::function<void(Scene&)>> changes{
      {"name", [](Scene& s) { s.name += "x"; }},
      {"mesh name", [](Scene& s) { s.meshes[0].name += "x"; }},
      {"position", [](Scene& s) { s.meshes[0].positions[2].z = 1e-45F; }},
      {"normal", [](Scene& s) { s.meshes[0].normals[1].x = 0.5F; }},
      {"uv 0", [](Scene& s) { s.meshes[0].uvs[0][0].x = 0.5F; }},
      {"uv 1", [](Scene& s) { s.meshes[0].uvs[1][2].y = 0.5F; }},
      {"uv set moved", [](Scene& s) { std::swap(s.meshes[0].uvs[0], s.meshes[0].uvs[1]); }},
      {"vertex color", [](Scene& s) { s.meshes[0].colors[1].a = 0.5F; }},
      {"tangent", [](Scene& s) { s.meshes[0].tangents[2].w = 1.0F; }},
      {"triangle", [](Scene& s) { s.meshes[0].triangles[0].x = 2; }},
      {"mesh material", [](Scene& s) { s.meshes[0].material = 0; }},
      {"mesh removed", [](Scene& s) { s.meshes.pop_back(); }},
      {"material name", [](Scene& s) { s.materials[1].name += "x"; }},
      {"base color", [](Scene& s) { s.materials[1].base_color.a = 0.9F; }},
      {"base color texture", [](Scene& s) { s.materials[1].base_color_texture.texture = -1; }},
      {"uv set", [](Scene& s) { s.materials[1].base_color_texture.uv_set = 0; }},
      {"uv transform", [](Scene& s) { s.materials[1].base_color_texture.transform[5] = 0.1F; }},
      {"metallic", [](Scene& s) { s.materials[1].metallic = 0.9F; }},
      {"roughness", [](Scene& s) { s.materials[1].roughness = 0.9F; }},
      {"metallic-roughness texture", [](Scene& s) { s.materials[1].metallic_roughness_texture.texture = -1; }},
      {"emissive", [](Scene& s) { s.materials[1].emissive.y = 0.9F; }},
      {"emissive texture", [](Scene& s) { s.materials[1].emissive_texture.texture = -1; }},
      {"normal texture", [](Scene& s) { s.materials[1].normal_texture.texture = -1; }},
      {"normal scale", [](Scene& s) { s.materials[1].normal_scale = 0.9F; }},
      {"occlusion texture", [](Scene& s) { s.materials[1].occlusion_texture.texture = -1; }},
      {"occlusion strength", [](Scene& s) { s.materials[1].occlusion_strength = 0.9F; }},
      {"transmission", [](Scene& s) { s.materials[1].transmission = 0.9F; }},
      {"transmission texture", [](Scene& s) { s.materials[1].transmission_texture.texture = -1; }},
      {"thickness", [](Scene& s) { s.materials[1].thickness = 0.9F; }},
      {"attenuation color", [](Scene& s) { s.materials[1].attenuation_color.b = 0.9F; }},
      {"attenuation distance", [](Scene& s) { s.materials[1].attenuation_distance = 0.9F; }},
      {"ior", [](Scene& s) { s.materials[1].ior = 1.9F; }},
      {"alpha mode", [](Scene& s) { s.materials[1].alpha_mode = AlphaMode::Blend; }},
      {"alpha cutoff", [](Scene& s) { s.materials[1].alpha_cutoff = 0.9F; }},
      {"double sided", [](Scene& s) { s.materials[1].double_sided = false; }},
      {"unlit", [](Scene& s) { s.materials[1].unlit = false; }},
      {"no extensions", [](Scene& s) { s.materials[1].extensions.reset(); }},
      {"extensions of another", [](Scene& s) { s.materials[0].extensions.swap(s.materials[1].extensions); }},
      {"specular", [](Scene& s) { extend(s, &MaterialExtensions::specular, 0.01F); }},
      {"specular color", [](Scene& s) { extend(s, &MaterialExtensions::specular_color, glm::vec3(0.01F)); }},
      {"clearcoat", [](Scene& s) { extend(s, &MaterialExtensions::clearcoat, 0.01F); }},
      {"clearcoat roughness", [](Scene& s) { extend(s, &MaterialExtensions::clearcoat_roughness, 0.01F); }},
      {"clearcoat scale", [](Scene& s) { extend(s, &MaterialExtensions::clearcoat_normal_scale, 0.01F); }},
      {"sheen color", [](Scene& s) { extend(s, &MaterialExtensions::sheen_color, glm::vec3(0.01F)); }},
      {"sheen roughness", [](Scene& s) { extend(s, &MaterialExtensions::sheen_roughness, 0.01F); }},
      {"anisotropy", [](Scene& s) { extend(s, &MaterialExtensions::anisotropy, 0.01F); }},
      {"anisotropy rotation", [](Scene& s) { extend(s, &MaterialExtensions::anisotropy_rotation_radians, 0.01F); }},
      {"iridescence", [](Scene& s) { extend(s, &MaterialExtensions::iridescence, 0.01F); }},
      {"iridescence index", [](Scene& s) { extend(s, &MaterialExtensions::iridescence_ior, 1.01F); }},
      {"iridescence minimum", [](Scene& s) { extend(s, &MaterialExtensions::iridescence_min_nm, 0.01F); }},
      {"iridescence maximum", [](Scene& s) { extend(s, &MaterialExtensions::iridescence_max_nm, 0.01F); }},
      {"dispersion", [](Scene& s) { extend(s, &MaterialExtensions::dispersion, 0.01F); }},
      {"diffuse transmission", [](Scene& s) { extend(s, &MaterialExtensions::diffuse_transmission, 0.01F); }},
      {"diffuse transmission color",
       [](Scene& s) { extend(s, &MaterialExtensions::diffuse_transmission_color, glm::vec3(0.01F)); }},
      {"sheen texture", [](Scene& s) { extend(s, &MaterialExtensions::sheen_color_texture, TextureRef{}); }},
      {"film texture", [](Scene& s) { extend(s, &MaterialExtensions::iridescence_thickness_texture, TextureRef{}); }},
      {"texture name", [](Scene& s) { s.textures[0].name += "x"; }},
      {"texel",
       [](Scene& s) {
         Image<Rgba8> image = s.textures[0].image.image();
         image.at(1, 2).a = 5;
         s.textures[0].image = std::move(image);
       }},
      {"texture shape",
       [](Scene& s) {
         s.textures[0].image = Image<Rgba8>({3, 2}, {1, 2, 3, 4});
       }},
      {"wrap s", [](Scene& s) { s.textures[0].wrap_s = Wrap::Repeat; }},
      {"wrap t", [](Scene& s) { s.textures[0].wrap_t = Wrap::Repeat; }},
      {"nearest", [](Scene& s) { s.textures[0].nearest = false; }},
      {"instance mesh", [](Scene& s) { s.instances[0].mesh = 1; }},
      {"to world", [](Scene& s) { s.instances[0].to_world[0][1] = 1e-300; }},
      {"first surface", [](Scene& s) { s.instances[0].first_surface = 7; }},
      {"light name", [](Scene& s) { s.lights[0].name += "x"; }},
      {"light type", [](Scene& s) { s.lights[0].type = LightType::Point; }},
      {"light position", [](Scene& s) { s.lights[0].position.z = 0; }},
      {"light direction", [](Scene& s) { s.lights[0].direction.z = 1; }},
      {"light intensity", [](Scene& s) { s.lights[0].intensity.z = 1; }},
      {"light range", [](Scene& s) { s.lights[0].range = 1; }},
      {"inner cone", [](Scene& s) { s.lights[0].inner_cone_radians = 0; }},
      {"outer cone", [](Scene& s) { s.lights[0].outer_cone_radians = 1; }},
      {"light radius", [](Scene& s) { s.lights[0].radius = 1; }},
      {"light angular radius", [](Scene& s) { s.lights[0].angular_radius_radians = 1; }},
      {"camera name", [](Scene& s) { s.cameras[0].name += "x"; }},
      {"camera eye", [](Scene& s) { s.cameras[0].eye.x = 9; }},
      {"camera axes", [](Scene& s) { s.cameras[0].axes[1][2] = 9; }},
      {"field of view",
       [](Scene& s) {
         s.cameras[0].lens = PerspectiveLens{1.1, 0.1};
       }},
      {"near",
       [](Scene& s) {
         s.cameras[0].lens = PerspectiveLens{1.0, 0.2};
       }},
      {"half width",
       [](Scene& s) {
         s.cameras[1].lens = OrthographicLens{9, 2, 3, 4};
       }},
      {"half height",
       [](Scene& s) {
         s.cameras[1].lens = OrthographicLens{1, 9, 3, 4};
       }},
      {"orthographic near",
       [](Scene& s) {
         s.cameras[1].lens = OrthographicLens{1, 2, 9, 4};
       }},
      {"orthographic far",
       [](Scene& s) {
         s.cameras[1].lens = OrthographicLens{1, 2, 3, 9};
       }},
      {"background r", [](Scene& s) { s.background.r = 1; }},
      {"background b", [](Scene& s) { s.background.b = 1; }},
      {"no environment", [](Scene& s) { s.environment.reset(); }},
      {"environment texel", [](Scene& s) { s.environment->image.at(1, 0).g = 5; }},
      {"environment shape",
       [](Scene& s) {
         s.environment->image = Image<Rgb>({1, 2}, {1, 2, 3});
       }},
      {"environment rotation", [](Scene& s) { s.environment->rotation_radians = 0.6; }},
      {"environment scale", [](Scene& s) { s.environment->scale = 1.0; }},
      {"warnings", [](Scene& s) { s.warnings.clear(); }},
      {"triangles", [](Scene& s) { s.triangles = 1; }},
      {"bounds low", [](Scene& s) { s.bounds.low.y = -1; }},
      {"bounds high", [](Scene& s) { s.bounds.high.y = 100; }},
  };
  std::map<std::uint64_t, std::string> seen{{content_hash(full_scene()), "the unchanged scene"}};
  for (const auto& [what, change] : changes) {
    Scene scene = full_scene();
    change(scene);
    const auto [entry, fresh] = seen.emplace(content_hash(scene), what);
    EXPECT_TRUE(fresh) << what << " hashes like " << entry->second;
    EXPECT_EQ(content_hash(scene_from_bytes(to_bytes(scene))), content_hash(scene)) << what;
  }
}

}  // namespace
}  // namespace hpr
