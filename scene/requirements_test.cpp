#include "scene/requirements.h"

#include <gtest/gtest.h>

namespace hpr {
namespace {

Scene scene_of(const Material& material, std::vector<Light> lights = {}) {
  Scene scene;
  scene.materials.push_back(material);
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.normals.assign(3, {0, 0, 1});
  mesh.triangles = {{0, 1, 2}};
  scene.meshes.push_back(mesh);
  scene.instances.push_back({0, glm::dmat4(1.0), 0});
  scene.lights = std::move(lights);
  finish_scene(scene);
  return scene;
}

Material rough(float roughness) {
  Material material;
  material.roughness = roughness;
  return material;
}

TEST(Requirements, ShadowsNeedALightThatCasts) {
  EXPECT_FALSE(requirements_of(scene_of(rough(1.0F))).shadow.needed);
  Light headlight;
  headlight.type = LightType::Headlight;
  EXPECT_FALSE(requirements_of(scene_of(rough(1.0F), {headlight})).shadow.needed);
  const Requirement one = requirements_of(scene_of(rough(1.0F), {headlight, Light{}})).shadow;
  EXPECT_TRUE(one.needed);
  EXPECT_EQ(one.why, "1 light casts shadows");
}

TEST(Requirements, EmittingSurfacesAndTheEnvironmentAreLights) {
  Material glowing = rough(1.0F);
  glowing.emissive = {0.0F, 0.5F, 0.0F};
  Scene scene = scene_of(glowing, {Light{}});
  EXPECT_EQ(requirements_of(scene).shadow.why, "2 lights cast shadows");
  scene.environment = Environment{Image<Rgb>({1, 1}, {0, 0, 1})};
  EXPECT_EQ(requirements_of(scene).shadow.why, "3 lights cast shadows");
  scene.environment->scale = 0.0;
  scene.lights.clear();
  EXPECT_EQ(requirements_of(scene).shadow.why, "1 light casts shadows");
  EXPECT_TRUE(gives_light(scene));

  scene.textures.emplace_back();
  scene.textures[0].image = Image<Rgba8>({2, 2}, Rgba8{255, 0, 255, 255});
  scene.materials[0].emissive_texture.texture = 0;
  EXPECT_FALSE(gives_light(scene)) << "a green light under a texture without green";
  EXPECT_FALSE(requirements_of(scene).shadow.needed);
  Image<Rgba8> image = scene.textures[0].image.image();
  image.at(1, 1).g = 1;
  scene.textures[0].image = std::move(image);
  EXPECT_TRUE(gives_light(scene));
  scene.instances.clear();
  EXPECT_FALSE(gives_light(scene)) << "no surface shows the material";
  scene.environment->scale = 1.0;
  EXPECT_TRUE(gives_light(scene));
}

TEST(Requirements, AnEnvironmentThatIsBlackAsksForDarkness) {
  Scene scene = scene_of(rough(1.0F));
  EXPECT_FALSE(gives_light(scene));
  scene.environment = Environment{Image<Rgb>({1, 1}, {0, 0, 0})};
  EXPECT_TRUE(gives_light(scene));
  EXPECT_FALSE(requirements_of(scene).shadow.needed);
}

TEST(Requirements, WhatIsNotThereNeedsNothing) {
  Material glowing = rough(0.0F);
  glowing.emissive = glm::vec3(1.0F);
  for (const AlphaMode mode : {AlphaMode::Mask, AlphaMode::Blend}) {
    Scene scene = scene_of(glowing);
    scene.materials[0].alpha_mode = mode;
    scene.materials[0].alpha_cutoff = 0.5F;
    scene.materials[0].base_color.a = 0.5F;
    EXPECT_TRUE(gives_light(scene));
    scene.materials[0].base_color.a = 0.0F;
    EXPECT_FALSE(gives_light(scene));
    EXPECT_FALSE(requirements_of(scene).reflection.needed);
  }
  Scene scene = scene_of(glowing);
  scene.instances[0].to_world = glm::dmat4(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1);
  EXPECT_TRUE(gives_light(scene)) << "flat, but with an area";
  scene.instances[0].to_world[1] = {0, 0, 0, 0};
  EXPECT_FALSE(gives_light(scene)) << "a line";
}

TEST(Requirements, ReflectionsNeedAMaterialBelowTheMirrorRoughness) {
  EXPECT_TRUE(requirements_of(scene_of(rough(0.0F))).reflection.needed);
  EXPECT_TRUE(requirements_of(scene_of(rough(0.29F))).reflection.needed);
  EXPECT_FALSE(requirements_of(scene_of(rough(kMirrorRoughness))).reflection.needed);
}

TEST(Requirements, ExtensionsCount) {
  const auto with = [](Material material, const auto& set) {
    MaterialExtensions extensions;
    set(extensions);
    material.extensions = std::make_shared<const MaterialExtensions>(extensions);
    return requirements_of(scene_of(material));
  };
  const auto coat = [](MaterialExtensions& e) { e.clearcoat = 1.0F; };
  EXPECT_TRUE(with(rough(1.0F), coat).reflection.needed) << "a smooth coat mirrors";
  EXPECT_EQ(with(rough(1.0F), coat).min_roughness, 0.0F);
  Material lambert = rough(1.0F);
  lambert.metallic = 0.0F;
  lambert.ior = 1.0F;
  EXPECT_FALSE(with(lambert, [](MaterialExtensions& e) { e.sheen_color = glm::vec3(1.0F); }).refraction.needed);
  EXPECT_TRUE(with(lambert, [](MaterialExtensions& e) { e.diffuse_transmission = 0.5F; }).refraction.needed);
  Material plastic = rough(0.1F);
  plastic.metallic = 0.0F;
  EXPECT_TRUE(with(plastic, [](MaterialExtensions& e) { e.dispersion = 0.5F; }).reflection.needed);
  EXPECT_FALSE(with(plastic, [](MaterialExtensions& e) { e.specular = 0.0F; }).reflection.needed);
}

TEST(Requirements, ASmoothTexelMakesARoughMaterialMirror) {
  Scene scene = scene_of(rough(1.0F));
  scene.textures.emplace_back();
  scene.textures[0].image = Image<Rgba8>({4, 4}, Rgba8{0, 255, 0, 255});
  scene.materials[0].metallic_roughness_texture.texture = 0;
  EXPECT_FALSE(requirements_of(scene).reflection.needed);
  Image<Rgba8> image = scene.textures[0].image.image();
  image.at(2, 3).g = 40;
  scene.textures[0].image = std::move(image);
  EXPECT_TRUE(requirements_of(scene).reflection.needed);
}

TEST(Requirements, MaterialsNoTriangleShowsDoNotCount) {
  Scene scene = scene_of(rough(1.0F));
  scene.materials.push_back(rough(0.0F));
  scene.materials.back().transmission = 1.0F;
  scene.materials.back().metallic = 0.0F;
  EXPECT_FALSE(requirements_of(scene).reflection.needed);
  EXPECT_FALSE(requirements_of(scene).refraction.needed);
  scene.meshes[0].material = 1;
  EXPECT_TRUE(requirements_of(scene).reflection.needed);
  EXPECT_TRUE(requirements_of(scene).refraction.needed);
}

TEST(Requirements, CausticsNeedBothALightAndASurfaceThatBundles) {
  Material glossy = rough(0.0F);
  glossy.metallic = 0.0F;
  EXPECT_FALSE(requirements_of(scene_of(glossy)).photon.needed);
  EXPECT_FALSE(requirements_of(scene_of(rough(1.0F), {Light{}})).photon.needed);
  EXPECT_TRUE(requirements_of(scene_of(glossy, {Light{}})).photon.needed);
}

TEST(Requirements, CausticsNeedASurfaceToFallOn) {
  Material metal = rough(0.0F);
  metal.metallic = 1.0F;
  EXPECT_TRUE(requirements_of(scene_of(metal, {Light{}})).reflection.needed);
  EXPECT_FALSE(requirements_of(scene_of(metal, {Light{}})).photon.needed) << "mirrors alone";
  Material glass = rough(0.0F);
  glass.metallic = 0.0F;
  glass.transmission = 1.0F;
  EXPECT_TRUE(requirements_of(scene_of(glass, {Light{}})).refraction.needed);
  EXPECT_FALSE(requirements_of(scene_of(glass, {Light{}})).photon.needed) << "glass alone";
  glass.transmission = 0.9F;
  EXPECT_TRUE(requirements_of(scene_of(glass, {Light{}})).photon.needed) << "a tenth of it is matte";
}

TEST(Requirements, WhatAMaterialIsMadeOfDecidesWhatItMirrorsAndTransmits) {
  Material invisible = rough(0.0F);
  invisible.metallic = 0.0F;
  invisible.ior = 1.0F;
  EXPECT_FALSE(requirements_of(scene_of(invisible, {Light{}})).reflection.needed) << "no boundary, no reflection";
  EXPECT_EQ(requirements_of(scene_of(invisible, {Light{}})).min_roughness, 1.0F);
  Material clear = rough(0.0F);
  clear.metallic = 0.0F;
  clear.transmission = 1.0F;
  EXPECT_TRUE(requirements_of(scene_of(clear, {Light{}})).refraction.needed);
  Material metal = clear;
  metal.metallic = 1.0F;
  Material black = clear;
  black.base_color = {0.0F, 0.0F, 0.0F, 1.0F};
  Scene dark = scene_of(clear, {Light{}});
  dark.textures.emplace_back();
  dark.textures[0].image = Image<Rgba8>({2, 2}, {0, 255, 255, 255});
  dark.materials[0].transmission_texture.texture = 0;
  EXPECT_FALSE(requirements_of(dark).refraction.needed) << "a texture that lets nothing through";
  Image<Rgba8> image = dark.textures[0].image.image();
  image.at(1, 0).r = 1;
  dark.textures[0].image = std::move(image);
  EXPECT_TRUE(requirements_of(dark).refraction.needed);
  Material grazing = metal;
  grazing.base_color = black.base_color;
  EXPECT_TRUE(requirements_of(scene_of(grazing, {Light{}})).reflection.needed)
      << "black metal mirrors at grazing angles";
  EXPECT_EQ(requirements_of(scene_of(grazing, {Light{}})).min_roughness, 0.0F);
  Material wall = clear;
  wall.ior = 0.0F;
  for (const Material& opaque : {metal, black, wall}) {
    EXPECT_FALSE(requirements_of(scene_of(opaque, {Light{}})).refraction.needed);
    EXPECT_TRUE(requirements_of(scene_of(opaque, {Light{}})).reflection.needed);
  }
}

TEST(Requirements, RoughPlasticScattersWhateverItsColour) {
  Material black = rough(1.0F);
  black.metallic = 0.0F;
  black.base_color = {0.0F, 0.0F, 0.0F, 1.0F};
  EXPECT_TRUE(requirements_of(scene_of(black, {Light{}})).indirect.needed);
  EXPECT_FALSE(requirements_of(scene_of(black, {Light{}})).ambient_occlusion.needed);
  black.ior = 1.0F;
  EXPECT_FALSE(requirements_of(scene_of(black, {Light{}})).indirect.needed);
  black.metallic = 1.0F;
  EXPECT_TRUE(requirements_of(scene_of(black, {Light{}})).indirect.needed) << "metals reflect at grazing angles";
}

TEST(Requirements, ATexelWithoutMetalIsDiffuse) {
  Material metal = rough(0.1F);
  metal.metallic = 1.0F;
  Scene scene = scene_of(metal, {Light{}});
  EXPECT_FALSE(requirements_of(scene).ambient_occlusion.needed);
  scene.textures.emplace_back();
  scene.textures[0].image = Image<Rgba8>({2, 2}, Rgba8{0, 255, 255, 255});
  scene.materials[0].metallic_roughness_texture.texture = 0;
  EXPECT_FALSE(requirements_of(scene).ambient_occlusion.needed);
  Image<Rgba8> image = scene.textures[0].image.image();
  image.at(1, 0).b = 0;
  scene.textures[0].image = std::move(image);
  EXPECT_TRUE(requirements_of(scene).ambient_occlusion.needed);
  EXPECT_TRUE(requirements_of(scene).indirect.needed);
}

TEST(Requirements, UnlitMaterialsAndDarkLightsAskForNothing) {
  Material poster = rough(0.0F);
  poster.unlit = true;
  const Requirements needs = requirements_of(scene_of(poster, {Light{}}));
  EXPECT_FALSE(needs.reflection.needed);
  EXPECT_FALSE(needs.photon.needed);
  EXPECT_FALSE(needs.shadow.needed) << "nothing takes light";
  EXPECT_EQ(needs.min_roughness, 1.0F);
  Light dark;
  dark.intensity = glm::vec3(0.0F);
  EXPECT_FALSE(requirements_of(scene_of(rough(1.0F), {dark})).shadow.needed);
}

TEST(Requirements, AnEmptySceneNeedsNothingAndSaysWhy) {
  Scene scene;
  scene.lights.resize(1);
  finish_scene(scene);
  const Requirements needs = requirements_of(scene);
  for (const Requirement& one : {needs.shadow, needs.reflection, needs.refraction, needs.photon}) {
    EXPECT_FALSE(one.needed);
    EXPECT_EQ(one.why, "no triangle of the scene can be seen");
  }
}

}  // namespace
}  // namespace hpr
