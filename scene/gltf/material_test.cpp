// What a glTF file says of surfaces beyond the core's factors: maps of detail, glass, vertex colours and tangents.
#include <gtest/gtest.h>
#include <webp/encode.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <span>

#include "scene/gltf/test_tools.h"

namespace hpr {
namespace {

using test::load;
using test::refusal;
using test::triangle;

/// A triangle with texture coordinates of both sets, one picture of 1 x 1 texels as texture 0, and `material`.
test::Document dressed(const Json& material) {
  auto document = triangle();
  document.json["images"].push_back(
      {{"uri",
        "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGP4z8AAAAMBAQDJ/pLvAAAAAElF"
        "TkSuQmCC"}});
  document.json["textures"].push_back({{"source", 0}});
  document.primitive()["attributes"]["TEXCOORD_0"] = document.add_vec2({0, 0, 1, 0, 0, 1});
  document.primitive()["attributes"]["TEXCOORD_1"] = document.add_vec2({0, 0, 2, 0, 0, 2});
  document.json["materials"].push_back(material);
  document.primitive()["material"] = 0;
  return document;
}

Material material_of(const char* text) {
  const Scene scene = load(dressed(Json::parse(text)).json);
  EXPECT_EQ(scene.warnings, std::vector<std::string>{});
  return scene.materials.at(0);
}

void expect_refused(const Json& document, const std::string& where) {
  const test::Refusal found = refusal(document);
  EXPECT_EQ(found.code, ExitCode::BadInput) << where << ": " << found.message;
  EXPECT_NE(found.message.find(where), std::string::npos) << found.message;
}

/// A triangle with normals and the attribute `name`, of four or three floats a vertex.
test::Document with_floats(const char* name, const char* type, const std::vector<float>& values) {
  auto document = triangle();
  document.primitive()["attributes"]["NORMAL"] = document.add_vec3({0, 0, 1, 0, 0, 1, 0, 0, 1});
  document.primitive()["attributes"][name] = document.add(values, type, 5126, 3);
  return document;
}

TEST(GltfMaterial, ExtensionsHaveTheirFactorsAndTextures) {
  const Material material = material_of(R"({"extensions": {
    "KHR_materials_specular": {"specularFactor": 0.9, "specularTexture": {"index": 0, "texCoord": 1},
        "specularColorFactor": [0.5, 2, 1], "specularColorTexture": {"index": 0}},
    "KHR_materials_clearcoat": {"clearcoatFactor": 0.8, "clearcoatTexture": {"index": 0},
        "clearcoatRoughnessFactor": 0.7, "clearcoatRoughnessTexture": {"index": 0},
        "clearcoatNormalTexture": {"index": 0, "scale": 0.5}},
    "KHR_materials_sheen": {"sheenColorFactor": [0.1, 0.2, 0.3], "sheenColorTexture": {"index": 0},
        "sheenRoughnessFactor": 0.6, "sheenRoughnessTexture": {"index": 0}},
    "KHR_materials_anisotropy": {"anisotropyStrength": 0.5, "anisotropyRotation": 1.5,
        "anisotropyTexture": {"index": 0}},
    "KHR_materials_iridescence": {"iridescenceFactor": 0.4, "iridescenceTexture": {"index": 0},
        "iridescenceIor": 1.6, "iridescenceThicknessMinimum": 50, "iridescenceThicknessMaximum": 700,
        "iridescenceThicknessTexture": {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2, 3]}}}},
    "KHR_materials_dispersion": {"dispersion": 0.3},
    "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 0.2,
        "diffuseTransmissionTexture": {"index": 0}, "diffuseTransmissionColorFactor": [1, 0.5, 0],
        "diffuseTransmissionColorTexture": {"index": 0}}}})");
  ASSERT_TRUE(material.extensions);
  const MaterialExtensions& read = *material.extensions;
  for (const TextureRef* texture : read.textures()) EXPECT_TRUE(texture->present());
  EXPECT_EQ(read.specular, 0.9F);
  EXPECT_EQ(read.specular_texture.uv_set, 1U);
  EXPECT_EQ(read.specular_color, glm::vec3(0.5F, 2.0F, 1.0F));
  EXPECT_EQ(read.clearcoat, 0.8F);
  EXPECT_EQ(read.clearcoat_roughness, 0.7F);
  EXPECT_EQ(read.clearcoat_normal_scale, 0.5F);
  EXPECT_EQ(read.sheen_color, glm::vec3(0.1F, 0.2F, 0.3F));
  EXPECT_EQ(read.sheen_roughness, 0.6F);
  EXPECT_EQ(read.anisotropy, 0.5F);
  EXPECT_EQ(read.anisotropy_rotation_radians, 1.5F);
  EXPECT_EQ(read.iridescence, 0.4F);
  EXPECT_EQ(read.iridescence_ior, 1.6F);
  EXPECT_EQ(read.iridescence_min_nm, 50.0F);
  EXPECT_EQ(read.iridescence_max_nm, 700.0F);
  EXPECT_EQ(read.iridescence_thickness_texture.transform[3], 3.0F);
  EXPECT_EQ(read.dispersion, 0.3F);
  EXPECT_EQ(read.diffuse_transmission, 0.2F);
  EXPECT_EQ(read.diffuse_transmission_color, glm::vec3(1.0F, 0.5F, 0.0F));
}

TEST(GltfMaterial, ExtensionsOfNoEffectAreNone) {
  for (
      const char* text :
      {R"({"extensions": {"KHR_materials_clearcoat": {"clearcoatRoughnessFactor": 0.4, "clearcoatTexture": {"index": 0}},
            "KHR_materials_specular": {"specularFactor": 1}, "KHR_materials_sheen": {"sheenRoughnessFactor": 0.5}}})",
       R"({"extensions": {"KHR_materials_unlit": {}, "KHR_materials_clearcoat": {"clearcoatFactor": 1}}})"}) {
    EXPECT_FALSE(material_of(text).extensions) << text;
  }
}

TEST(GltfMaterial, RequiredExtensionsOfMaterialsAreAccepted) {
  for (const char* name :
       {"specular", "clearcoat", "sheen", "anisotropy", "iridescence", "dispersion", "diffuse_transmission"}) {
    const std::string extension = std::string("KHR_materials_") + name;
    test::Document document = dressed(Json{{"extensions", {{extension, Json::object()}}}});
    document.json["extensionsUsed"] = Json::array({extension});
    document.json["extensionsRequired"] = Json::array({extension});
    EXPECT_EQ(load(document.json).warnings, std::vector<std::string>{}) << name;
  }
}

TEST(GltfMaterial, MapsOfDetailKeepTheirStrengthAndPosition) {
  const Material material = material_of(R"({
    "normalTexture": {"index": 0, "texCoord": 1, "scale": -0.5,
                      "extensions": {"KHR_texture_transform": {"scale": [2, 3], "texCoord": 0}}},
    "occlusionTexture": {"index": 0, "texCoord": 1, "strength": 0.25}})");
  EXPECT_TRUE(material.normal_texture.present());
  EXPECT_EQ(material.normal_texture.uv_set, 0U);
  EXPECT_EQ(material.normal_texture.transform[3], 3.0F);
  EXPECT_EQ(material.normal_scale, -0.5F);
  EXPECT_TRUE(material.occlusion_texture.present());
  EXPECT_EQ(material.occlusion_texture.uv_set, 1U);
  EXPECT_EQ(material.occlusion_strength, 0.25F);
}

TEST(GltfMaterial, GlassHasAMapAVolumeAndItsColor) {
  const Material material = material_of(R"({"extensions": {
    "KHR_materials_transmission": {"transmissionFactor": 1, "transmissionTexture":
        {"index": 0, "texCoord": 1, "extensions": {"KHR_texture_transform": {"offset": [0.5, 0.25]}}}},
    "KHR_materials_volume": {"thicknessFactor": 0.2, "attenuationDistance": 3, "attenuationColor": [1, 0.5, 0]}}})");
  EXPECT_TRUE(material.transmission_texture.present());
  EXPECT_EQ(material.transmission_texture.uv_set, 1U);
  EXPECT_EQ(material.transmission_texture.transform[4], 0.5F);
  EXPECT_EQ(material.thickness, 0.2F);
  EXPECT_EQ(material.attenuation_distance, 3.0F);
  EXPECT_EQ(material.attenuation_color, glm::vec3(1.0F, 0.5F, 0.0F));
  const Material thin = material_of(R"({"extensions": {"KHR_materials_volume": {}}})");
  EXPECT_EQ(thin.thickness, 0.0F);
  EXPECT_EQ(thin.attenuation_distance, std::numeric_limits<float>::infinity());
  EXPECT_EQ(thin.attenuation_color, glm::vec3(1.0F));
}

TEST(GltfMaterial, UnlitIsAnExtensionWithoutMembers) {
  EXPECT_TRUE(material_of(R"({"extensions": {"KHR_materials_unlit": {}}})").unlit);
  EXPECT_FALSE(material_of("{}").unlit);
}

TEST(GltfMaterial, SupportedExtensionsAreNotWarnedOf) {
  auto document = triangle();
  const Json names = Json::array({"KHR_materials_unlit", "KHR_materials_volume", "KHR_materials_transmission"});
  document.json["extensionsUsed"] = names;
  document.json["extensionsRequired"] = names;
  EXPECT_EQ(load(document.json).warnings, std::vector<std::string>{});
}

TEST(GltfMaterial, WrongTypesAreRefusedByName) {
  const std::pair<const char*, const char*> cases[] = {
      {R"({"normalTexture": 1})", "normalTexture"},
      {R"({"normalTexture": {"index": 7}})", "normalTexture.index"},
      {R"({"normalTexture": {"index": 0, "scale": "much"}})", "normalTexture.scale"},
      {R"({"occlusionTexture": {"index": 0, "strength": []}})", "occlusionTexture.strength"},
      {R"({"extensions": {"KHR_materials_unlit": true}})", "KHR_materials_unlit"},
      {R"({"extensions": {"KHR_materials_volume": []}})", "KHR_materials_volume"},
      {R"({"extensions": {"KHR_materials_volume": {"thicknessFactor": "2"}}})", "thicknessFactor"},
      {R"({"extensions": {"KHR_materials_volume": {"thicknessTexture": {"index": -1}}}})", "thicknessTexture"},
      {R"({"extensions": {"KHR_materials_volume": {"attenuationDistance": null}}})", "attenuationDistance"},
      {R"({"extensions": {"KHR_materials_volume": {"attenuationColor": [1, 1]}}})", "attenuationColor"},
      {R"({"extensions": {"KHR_materials_volume": {"attenuationColor": "red"}}})", "attenuationColor"},
      {R"({"extensions": {"KHR_materials_clearcoat": {"clearcoatNormalTexture": {"index": 3}}}})",
       "clearcoatNormalTexture"},
      {R"({"extensions": {"KHR_materials_sheen": {"sheenColorFactor": [1]}}})", "sheenColorFactor"},
      {R"({"extensions": {"KHR_materials_dispersion": {"dispersion": "much"}}})", "dispersion"},
      {R"({"extensions": {"KHR_materials_transmission": {"transmissionTexture": {"index": 1}}}})",
       "transmissionTexture.index"},
  };
  for (const auto& [material, where] : cases) expect_refused(dressed(Json::parse(material)).json, where);
}

TEST(GltfMaterial, NumbersOutOfRangeAreBroughtIntoItWithAWarning) {
  const Scene scene = load(dressed(Json::parse(R"({"occlusionTexture": {"index": 0, "strength": 3},
    "extensions": {"KHR_materials_volume": {"thicknessFactor": -1, "attenuationDistance": 0,
                                            "attenuationColor": [2, -1, 0.5]}}})"))
                               .json);
  const Material& material = scene.materials[0];
  EXPECT_EQ(material.occlusion_strength, 1.0F);
  EXPECT_EQ(material.thickness, 0.0F);
  EXPECT_GT(material.attenuation_distance, 0.0F);
  EXPECT_EQ(material.attenuation_color, glm::vec3(1.0F, 0.0F, 0.5F));
  for (const char* name : {"strength", "thicknessFactor", "attenuationDistance", "attenuationColor"}) {
    EXPECT_TRUE(test::warns_of(scene, name)) << name;
  }
}

TEST(GltfMaterial, VertexColorsHaveThreeOrFourChannelsOfFloatsOrIntegers) {
  Scene scene = load(with_floats("COLOR_0", "VEC3", {1, 0.5F, 0, 0, 0, 0, 1, 1, 1}).json);
  EXPECT_EQ(scene.meshes[0].colors.at(0), glm::vec4(1.0F, 0.5F, 0.0F, 1.0F));
  EXPECT_EQ(scene.warnings, std::vector<std::string>{});
  // Without normals every face gets vertices of its own, and they keep their colours.
  auto document = triangle();
  const int colors =
      document.add(std::vector<std::uint8_t>{255, 0, 51, 102, 0, 0, 0, 0, 255, 255, 255, 255}, "VEC4", 5121, 3);
  document.json["accessors"][static_cast<std::size_t>(colors)]["normalized"] = true;
  document.primitive()["attributes"]["COLOR_0"] = colors;
  scene = load(document.json);
  ASSERT_EQ(scene.meshes[0].colors.size(), 3U);
  EXPECT_EQ(scene.meshes[0].colors[0], glm::vec4(1.0F, 0.0F, 0.2F, 0.4F));
  EXPECT_EQ(scene.meshes[0].colors[2], glm::vec4(1.0F));
}

TEST(GltfMaterial, BadVertexColorsAreRefusedOrBroughtIntoRange) {
  auto document = triangle();
  document.primitive()["attributes"]["COLOR_0"] = document.add_vec2({0, 0, 1, 0, 0, 1});
  expect_refused(document.json, "COLOR_0");
  document = triangle();
  document.primitive()["attributes"]["COLOR_0"] =
      document.add(std::vector<std::uint8_t>(12, 255), "VEC4", 5121, 3);  // not normalised
  expect_refused(document.json, "COLOR_0");
  expect_refused(with_floats("COLOR_0", "VEC4", std::vector<float>(8, 1.0F)).json, "accessors");
  const Scene scene = load(with_floats("COLOR_0", "VEC4", {std::nanf(""), -1, 7, 0.5F, 1, 1, 1, 1, 1, 1, 1, 1}).json);
  EXPECT_EQ(scene.meshes[0].colors[0], glm::vec4(1.0F, 0.0F, 1.0F, 0.5F));
  EXPECT_TRUE(test::warns_of(scene, "COLOR_0"));
}

TEST(GltfMaterial, TangentsAreKeptMadeUnitOrLeftOut) {
  const std::vector<float> values{1, 0, 0, -1, 0, 2, 0, 0.5F, std::nanf(""), 0, 0, 1};
  const auto document = with_floats("TANGENT", "VEC4", values);
  const Scene scene = load(document.json);
  const auto& tangents = scene.meshes[0].tangents;
  ASSERT_EQ(tangents.size(), 3U);
  EXPECT_EQ(tangents[0], glm::vec4(1, 0, 0, -1));
  EXPECT_EQ(tangents[1], glm::vec4(0, 1, 0, 1));
  EXPECT_EQ(tangents[2], glm::vec4(0, 0, 0, 1));
  EXPECT_TRUE(test::warns_of(scene, "TANGENT"));
  auto flat = document;
  flat.primitive()["attributes"].erase("NORMAL");
  EXPECT_TRUE(load(flat.json).meshes[0].tangents.empty()) << "tangents mean nothing without the normals they go with";
  auto wrong = triangle();
  wrong.primitive()["attributes"]["TANGENT"] = wrong.add_vec3({1, 0, 0, 1, 0, 0, 1, 0, 0});
  expect_refused(wrong.json, "TANGENT");
}

TEST(GltfMaterial, SpecularGlossinessAloneIsTakenAsADielectric) {
  auto document = triangle();
  const Json glossy{{"diffuseFactor", Json::array({1, 0.5, 0, 0.75})}, {"glossinessFactor", 0.25}};
  document.json["materials"].push_back({{"extensions", {{"KHR_materials_pbrSpecularGlossiness", glossy}}}});
  document.json["extensionsUsed"] = Json::array({"KHR_materials_pbrSpecularGlossiness"});
  document.json["extensionsRequired"] = Json::array({"KHR_materials_pbrSpecularGlossiness"});
  document.primitive()["material"] = 0;
  const Scene scene = load(document.json);
  EXPECT_EQ(scene.materials[0].base_color, glm::vec4(1, 0.5F, 0, 0.75F));
  EXPECT_EQ(scene.materials[0].metallic, 0.0F);
  EXPECT_EQ(scene.materials[0].roughness, 0.75F);
  EXPECT_TRUE(test::warns_of(scene, "dielectric"));
  document.json["materials"][0]["pbrMetallicRoughness"] = {{"metallicFactor", 1}};
  EXPECT_EQ(load(document.json).materials[0].metallic, 1.0F) << "the stand-in of the file's own";
  document.json["materials"][0].erase("pbrMetallicRoughness");
  document.json["materials"][0]["extensions"]["KHR_materials_pbrSpecularGlossiness"]["diffuseFactor"] = "red";
  expect_refused(document.json, "baseColorFactor");
}

TEST(GltfMaterial, TangentsMoveWithMorphTargetsAndJoints) {
  auto document = with_floats("TANGENT", "VEC4", {1, 0, 0, -1, 1, 0, 0, -1, 1, 0, 0, -1});
  document.primitive()["targets"].push_back({{"TANGENT", document.add_vec3({-1, 1, 0, 0, 0, 0, 0, 0, 0})}});
  document.json["meshes"][0]["weights"] = Json::array({1});
  EXPECT_EQ(load(document.json).meshes[0].tangents[0], glm::vec4(0, 1, 0, -1));

  document = with_floats("TANGENT", "VEC4", {1, 0, 0, -1, 1, 0, 0, -1, 1, 0, 0, -1});
  document.primitive()["attributes"]["JOINTS_0"] = document.add(std::vector<std::uint8_t>(12, 0), "VEC4", 5121, 3);
  document.primitive()["attributes"]["WEIGHTS_0"] =
      document.add(std::vector<float>{1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, "VEC4", 5126, 3);
  document.json["nodes"] = Json::array({{{"mesh", 0}, {"skin", 0}}, {{"scale", Json::array({-3, 2, 2})}}});
  document.json["scenes"][0]["nodes"] = Json::array({0, 1});
  document.json["skins"].push_back({{"joints", Json::array({1})}});
  EXPECT_EQ(load(document.json).meshes[0].tangents[0], glm::vec4(-1, 0, 0, -1));
}

/// As a data URI.
Json picture_of(std::span<const std::byte> bytes) {
  return {{"uri", "data:application/octet-stream;base64," + base64(bytes)}};
}

std::vector<std::byte> webp_of(const Image<Rgba8>& image) {
  std::uint8_t* out = nullptr;
  const Size size = image.size();
  const std::size_t count = WebPEncodeLosslessRGBA(reinterpret_cast<const std::uint8_t*>(image.pixels().data()),
                                                   size.width, size.height, size.width * 4, &out);
  const auto bytes = std::as_bytes(std::span(out, count));
  std::vector<std::byte> copy(bytes.begin(), bytes.end());
  WebPFree(out);
  return copy;
}

Image<Rgba8> random_picture(std::mt19937& random) {
  Image<Rgba8> image({1 + static_cast<int>(random() % 40), 1 + static_cast<int>(random() % 40)});
  for (Rgba8& pixel : image.pixels()) {
    const auto level = [&] { return static_cast<std::uint8_t>(1 + random() % 255); };
    pixel = {level(), level(), level(), level()};
  }
  return image;
}

TEST(GltfTextures, WebpPicturesAreThoseOfPng) {
  std::mt19937 random(1);
  for (int i = 0; i < 20; ++i) {
    auto document = dressed(Json::parse(R"({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})"));
    const Image<Rgba8> image = random_picture(random);
    document.json["images"][0] = picture_of(encode_png(image));
    const Scene plain = load(document.json);
    // Beside the WebP picture stands another one, for renderers that do not read WebP.
    document.json["images"][0] = picture_of(encode_png(random_picture(random)));
    document.json["images"].push_back(picture_of(webp_of(image)));
    document.json["textures"][0]["extensions"]["EXT_texture_webp"]["source"] = 1;
    document.json["extensionsUsed"] = Json::array({"EXT_texture_webp"});
    if (i % 2 == 0) {
      document.json["extensionsRequired"] = Json::array({"EXT_texture_webp"});
      document.json["textures"][0].erase("source");
    }
    const Scene packed = load(document.json);
    EXPECT_TRUE(packed.warnings.empty()) << packed.warnings.front();
    ASSERT_EQ(packed.textures.size(), 1U);
    EXPECT_EQ(packed.textures[0].image.size(), image.size());
    EXPECT_TRUE(std::ranges::equal(packed.textures[0].image.pixels(), plain.textures.at(0).image.pixels()));
  }
}

TEST(GltfTextures, BrokenWebpIsLeftOutWithAWarning) {
  auto document = dressed(Json::parse(R"({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})"));
  std::mt19937 random(1);
  std::vector<std::byte> bytes = webp_of(random_picture(random));
  bytes.resize(bytes.size() / 2);
  document.json["images"][0] = picture_of(bytes);
  document.json["textures"][0]["extensions"]["EXT_texture_webp"]["source"] = 0;
  EXPECT_TRUE(test::warns_of(load(document.json), "ends too early"));
  document.json["textures"][0]["extensions"]["EXT_texture_webp"]["source"] = 1;
  expect_refused(document.json, "textures[0].extensions.EXT_texture_webp.source");
}

TEST(GltfTextures, Ktx2IsRefusedUnlessAnotherPictureStandsBesideIt) {
  auto document = dressed(Json::parse(R"({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})"));
  document.json["textures"][0]["extensions"]["KHR_texture_basisu"]["source"] = 0;
  document.json["extensionsUsed"] = Json::array({"KHR_texture_basisu"});
  for (const bool required : {false, true}) {
    if (required) document.json["extensionsRequired"] = Json::array({"KHR_texture_basisu"});
    const Scene scene = load(document.json);
    EXPECT_EQ(scene.textures.size(), 1U);
    EXPECT_TRUE(test::warns_of(scene, "textures[0]"));
  }
  document.json["textures"][0].erase("source");
  expect_refused(document.json, "textures[0]");
  EXPECT_NE(refusal(document.json).hint.find("ktxdecompress"), std::string::npos);
  document.json.erase("extensionsRequired");
  expect_refused(document.json, "textures[0]");
}

}  // namespace
}  // namespace hpr
