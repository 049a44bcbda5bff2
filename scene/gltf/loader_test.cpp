#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "scene/gltf/gltf.h"
#include "scene/gltf/test_tools.h"

namespace hpr {
namespace {

using test::load;
using test::square;
using test::triangle;

TEST(GltfLoader, AMeshWithoutNormalsIsFlat) {
  auto document = test::Document();
  // Two faces of a roof that share an edge.
  document.primitive()["attributes"]["POSITION"] = document.add_vec3({0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1});
  document.primitive()["indices"] = document.add_indices({0, 1, 2, 0, 3, 1});
  const Scene scene = load(document.json);
  const Mesh& mesh = scene.meshes.at(0);
  ASSERT_EQ(mesh.positions.size(), 6U);
  for (std::size_t corner = 0; corner < 3; ++corner) {
    EXPECT_EQ(mesh.normals[corner], glm::vec3(0, 0, 1));
    EXPECT_EQ(mesh.normals[3 + corner], glm::vec3(0, 1, 0));
  }
  EXPECT_EQ(mesh.triangles[1], glm::uvec3(3, 4, 5));
  EXPECT_EQ(mesh.positions[4], glm::vec3(0, 0, 1));
}

TEST(GltfLoader, NormalsBecomeUnitLengthAndUsableWhereTheyAreNot) {
  auto document = triangle();
  const float nan = std::nanf("");
  document.primitive()["attributes"]["NORMAL"] = document.add_vec3({0, 0, 1e30F, nan, 0, 0, 0, 0, 0});
  const Scene scene = load(document.json);
  EXPECT_EQ(scene.meshes[0].normals, std::vector<glm::vec3>(3, glm::vec3(0, 0, 1)));
  EXPECT_TRUE(test::warns_of(scene, "NORMAL"));
  EXPECT_TRUE(test::warns_of(scene, "NORMAL: 1 values are no finite numbers, the first at vertex 1"));
  EXPECT_EQ(scene.not_finite, 1U);
}

TEST(GltfLoader, StripsAndFansBecomeTrianglesThatFaceTheSameWay) {
  auto document = test::Document();
  document.primitive()["attributes"]["POSITION"] = document.add_vec3({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2, 0});
  document.primitive()["mode"] = 5;
  Scene scene = load(document.json);
  ASSERT_EQ(scene.triangles, 3U);
  for (const glm::vec3& normal : scene.meshes[0].normals) EXPECT_EQ(normal, glm::vec3(0, 0, 1));

  document = square();
  document.primitive()["mode"] = 6;
  scene = load(document.json);
  ASSERT_EQ(scene.triangles, 2U);
  for (const glm::vec3& normal : scene.meshes[0].normals) EXPECT_EQ(normal, glm::vec3(0, 0, 1));
}

TEST(GltfLoader, StridesAndIntegerTextureCoordinatesAreRead) {
  auto document = triangle();
  // Four bytes per vertex, of which two are u and v.
  const int uv = document.add(std::vector<std::uint8_t>{0, 255, 9, 9, 255, 0, 9, 9, 51, 102}, "VEC2", 5121, 3);
  document.json["accessors"][static_cast<std::size_t>(uv)]["normalized"] = true;
  document.json["bufferViews"][static_cast<std::size_t>(uv)]["byteStride"] = 4;
  document.primitive()["attributes"]["TEXCOORD_0"] = uv;
  const Scene scene = load(document.json);
  const auto& uvs = scene.meshes[0].uvs[0];
  ASSERT_EQ(uvs.size(), 3U);
  EXPECT_EQ(uvs[0], glm::vec2(0, 1));
  EXPECT_EQ(uvs[1], glm::vec2(1, 0));
  EXPECT_EQ(uvs[2], glm::vec2(0.2F, 0.4F));
}

TEST(GltfLoader, SparseAccessorsReplaceElementsAlsoOfZeros) {
  auto document = triangle();
  const int where = document.add_indices({1, 2});
  const int what = document.add_vec3({5, 6, 7, 8, 9, 10});
  auto& accessor = document.json["accessors"][0];
  accessor["sparse"] = {
      {"count", 2}, {"indices", {{"bufferView", where}, {"componentType", 5123}}}, {"values", {{"bufferView", what}}}};
  accessor.erase("bufferView");
  const Scene scene = load(document.json);
  EXPECT_EQ(scene.meshes[0].positions[0], glm::vec3(0));
  EXPECT_EQ(scene.meshes[0].positions[1], glm::vec3(5, 6, 7));
  EXPECT_EQ(scene.meshes[0].positions[2], glm::vec3(8, 9, 10));
}

TEST(GltfLoader, TransformsComposeFromTheRootDown) {
  auto document = triangle();
  const double h = std::numbers::sqrt2 / 2.0;  // a quarter turn about z
  document.json["nodes"] =
      Json::array({{{"children", Json::array({1})},
                    {"translation", Json::array({10, 0, 0})},
                    {"rotation", Json::array({0, 0, h, h})}},
                   {{"mesh", 0}, {"scale", Json::array({2, 3, 4})}, {"translation", Json::array({1, 0, 0})}}});
  const Scene scene = load(document.json);
  ASSERT_EQ(scene.instances.size(), 1U);
  const glm::dvec3 p = world_position(scene.instances[0], glm::vec3(1, 1, 1));
  EXPECT_NEAR(glm::distance(p, glm::dvec3(10 - 3, 3, 4)), 0.0, 1e-12);
}

TEST(GltfLoader, ARotationThatIsNoUnitQuaternionTurnsAndDoesNotScale) {
  auto document = triangle();
  document.node()["rotation"] = Json::array({0, 2, 0, 2});
  const Scene scene = load(document.json);
  EXPECT_TRUE(test::warns_of(scene, "no unit quaternion"));
  EXPECT_NEAR(glm::distance(glm::dvec3(scene.instances[0].to_world[0]), glm::dvec3(0, 0, -1)), 0.0, 1e-12);
}

TEST(GltfLoader, NodesThatShareAMeshAreInstances) {
  auto document = triangle();
  document.json["nodes"].push_back({{"mesh", 0}, {"translation", Json::array({1, 2, 3})}});
  document.json["scenes"][0]["nodes"] = Json::array({0, 1});
  const Scene scene = load(document.json);
  EXPECT_EQ(scene.meshes.size(), 1U);
  ASSERT_EQ(scene.instances.size(), 2U);
  EXPECT_EQ(scene.instances[1].first_surface, 1U);
}

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr int kChainDepth = 10'000;  // allocations cost a stack trace each there; recursion would fail as well
#else
constexpr int kChainDepth = 100'000;
#endif

TEST(GltfLoader, AVeryLongChainOfNodesLoads) {
  auto document = triangle();
  auto& nodes = document.json["nodes"] = Json::array();
  for (int i = 0; i < kChainDepth; ++i) {
    nodes.push_back({{"children", Json::array({i + 1})}, {"translation", Json::array({1, 0, 0})}});
  }
  nodes.push_back({{"mesh", 0}});
  const Scene scene = load(document.json);
  EXPECT_EQ(scene.instances.at(0).to_world[3].x, kChainDepth);
}

TEST(GltfLoader, LightsAndCamerasStandWhereTheirNodesPutThem) {
  auto document = triangle();
  document.json["extensions"]["KHR_lights_punctual"]["lights"].push_back(
      {{"type", "spot"}, {"intensity", 5}, {"color", Json::array({1, 0.5, 0})}, {"spot", {{"outerConeAngle", 0.5}}}});
  document.json["cameras"].push_back({{"type", "perspective"}, {"perspective", {{"yfov", 0.6}, {"znear", 0.1}}}});
  const double h = std::numbers::sqrt2 / 2.0;  // a quarter turn about y: -z becomes -x
  document.json["nodes"].push_back({{"camera", 0},
                                    {"translation", Json::array({1, 2, 3})},
                                    {"rotation", Json::array({0, h, 0, h})},
                                    {"scale", Json::array({2, 3, 4})},
                                    {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  document.json["scenes"][0]["nodes"] = Json::array({0, 1});
  const Scene scene = load(document.json);
  ASSERT_EQ(scene.lights.size(), 1U);
  EXPECT_EQ(scene.lights[0].type, LightType::Spot);
  EXPECT_EQ(scene.lights[0].intensity, glm::vec3(5, 2.5, 0));
  EXPECT_EQ(scene.lights[0].position, glm::dvec3(1, 2, 3));
  EXPECT_NEAR(glm::distance(scene.lights[0].direction, glm::vec3(-1, 0, 0)), 0.0F, 1e-6F);
  ASSERT_EQ(scene.cameras.size(), 1U);
  EXPECT_EQ(scene.cameras[0].eye, glm::dvec3(1, 2, 3));
  EXPECT_NEAR(glm::distance(scene.cameras[0].axes[2], glm::dvec3(1, 0, 0)), 0.0, 1e-12);
  EXPECT_NEAR(glm::distance(scene.cameras[0].axes[0], glm::dvec3(0, 0, -1)), 0.0, 1e-12);
  EXPECT_EQ(std::get<PerspectiveLens>(scene.cameras[0].lens).vertical_fov_radians, 0.6);
}

/// A document whose one node has this light.
Scene load_light(const Json& light) {
  auto document = triangle();
  document.json["extensions"]["KHR_lights_punctual"]["lights"].push_back(light);
  document.json["nodes"].push_back({{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  document.json["scenes"][0]["nodes"] = Json::array({0, 1});
  return load(document.json);
}

TEST(GltfLoader, ExtrasGiveLightsAnExtent) {
  EXPECT_EQ(load_light({{"type", "point"}, {"extras", {{"radius", 2}}}}).lights.at(0).radius, 2.0);
  EXPECT_EQ(load_light({{"type", "point"}, {"extras", "anything"}}).lights.at(0).radius, 0.0);
  const Scene sun = load_light({{"type", "directional"}, {"extras", {{"angularRadius", 0.25}, {"radius", 3}}}});
  EXPECT_EQ(sun.lights.at(0).angular_radius_radians, 0.25F);
  EXPECT_EQ(sun.lights.at(0).radius, 0.0);
  EXPECT_TRUE(sun.warnings.empty());
  for (const Json& radius : {Json(-1.0), Json("wide"), Json(1e300), Json(nullptr)}) {
    const Scene scene = load_light({{"type", "point"}, {"extras", {{"radius", radius}}}});
    EXPECT_EQ(scene.lights.at(0).radius, 0.0) << radius;
    ASSERT_EQ(scene.warnings.size(), 1U) << radius;
    EXPECT_NE(scene.warnings[0].find("radius"), std::string::npos) << scene.warnings[0];
  }
}

TEST(GltfLoader, MaterialsKeepTheirFactorsAndExtensions) {
  auto document = triangle();
  document.json["materials"] = Json::parse(R"([{"name": "glass", "doubleSided": true, "alphaMode": "MASK",
    "alphaCutoff": 0.25, "emissiveFactor": [1, 0.5, 0],
    "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5, "roughnessFactor": 7},
    "extensions": {"KHR_materials_ior": {"ior": 1.3}, "KHR_materials_transmission": {"transmissionFactor": 0.9},
                   "KHR_materials_emissive_strength": {"emissiveStrength": 4}}}])");
  document.primitive()["material"] = 0;
  const Scene scene = load(document.json);
  ASSERT_EQ(scene.materials.size(), 1U);
  const Material& material = scene.materials[0];
  EXPECT_EQ(material.name, "glass");
  EXPECT_EQ(material.base_color, glm::vec4(0.1F, 0.2F, 0.3F, 0.4F));
  EXPECT_EQ(material.metallic, 0.5F);
  EXPECT_EQ(material.roughness, 1.0F);
  EXPECT_TRUE(test::warns_of(scene, "roughnessFactor"));
  EXPECT_EQ(material.emissive, glm::vec3(4, 2, 0));
  EXPECT_EQ(material.transmission, 0.9F);
  EXPECT_EQ(material.ior, 1.3F);
  EXPECT_EQ(material.alpha_mode, AlphaMode::Mask);
  EXPECT_EQ(material.alpha_cutoff, 0.25F);
  EXPECT_TRUE(material.double_sided);
}

TEST(GltfLoader, PrimitivesWithoutAMaterialGetTheDefaultOne) {
  auto document = triangle();
  document.json["materials"].push_back({{"name", "unused"}});
  const Scene scene = load(document.json);
  ASSERT_EQ(scene.materials.size(), 2U);
  EXPECT_EQ(scene.meshes[0].material, 1U);
}

TEST(GltfLoader, MorphTargetsMoveVerticesByTheNodesWeights) {
  auto document = triangle();
  const int deltas = document.add_vec3({0, 0, 1, 0, 0, 1, 0, 0, 1});
  document.primitive()["targets"].push_back({{"POSITION", deltas}});
  document.json["meshes"][0]["weights"] = Json::array({0.5});
  EXPECT_EQ(load(document.json).meshes[0].positions[0], glm::vec3(0, 0, 0.5F));
  document.node()["weights"] = Json::array({2});
  EXPECT_EQ(load(document.json).meshes[0].positions[0], glm::vec3(0, 0, 2));
}

TEST(GltfLoader, PrimitivesOfAMeshThatDifferInMorphTargetsAreWarnedOf) {
  auto document = triangle();
  const int target = document.add_vec3({0, 0, 1, 0, 0, 1, 0, 0, 1});
  document.json["meshes"][0]["primitives"].push_back(document.primitive());
  document.json["meshes"][0]["primitives"][0]["targets"] =
      Json::array({{{"POSITION", target}}, {{"POSITION", target}}});
  document.json["meshes"][0]["primitives"][1]["targets"] = Json::array({{{"POSITION", target}}});
  document.node()["weights"] = Json::array({1, 1});
  const Scene scene = load(document.json);
  EXPECT_TRUE(test::warns_of(scene, "meshes[0].primitives: some have 2 morph targets, others 1"));
  EXPECT_EQ(scene.meshes.at(0).positions.at(0), glm::vec3(0, 0, 2));
  EXPECT_EQ(scene.meshes.at(1).positions.at(0), glm::vec3(0, 0, 1));
}

TEST(GltfLoader, WeightsOfANodeThatAreNotAsManyAsTargetsAreWarnedOf) {
  auto document = triangle();
  document.node()["weights"] = Json::array({1});
  EXPECT_TRUE(test::warns_of(load(document.json), "nodes[0].weights: 1 weights for 0 morph targets"));
  const int target = document.add_vec3({0, 0, 1, 0, 0, 1, 0, 0, 1});
  document.primitive()["targets"] = Json::array({{{"POSITION", target}}});
  EXPECT_TRUE(load(document.json).warnings.empty());
}

TEST(GltfLoader, AnimationsAreWarnedOfOnce) {
  auto document = triangle();
  const int times = document.add(std::vector<float>{0, 1}, "SCALAR", 5126, 2);
  const int positions = document.add_vec3({0, 0, 0, 5, 0, 0});
  document.json["animations"] = Json::array(
      {{{"samplers", Json::array({{{"input", times}, {"output", positions}}})},
        {"channels", Json::array({{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}})}}});
  document.json["animations"].push_back(document.json["animations"][0]);
  const Scene scene = load(document.json);
  ASSERT_EQ(scene.warnings.size(), 1U);
  EXPECT_TRUE(test::warns_of(scene, "animations: the file has 2"));
  document.json["animations"] = Json::array();
  EXPECT_TRUE(load(document.json).warnings.empty());
}

TEST(GltfLoader, MorphTargetsMoveColoursAndTextureCoordinatesToo) {
  auto document = triangle();
  auto& attributes = document.primitive()["attributes"];
  attributes["TEXCOORD_1"] = document.add_vec2({0, 0, 1, 0, 0, 1});
  attributes["COLOR_0"] = document.add_vec3({1, 0, 0, 1, 0, 0, 1, 0, 0});
  const int shift = document.add_vec2({0.5F, 2, 0, 0, 0, 0});
  const int green = document.add_vec3({-1, 1, 0, 0, 0, 5, 0, 0, 0});
  document.primitive()["targets"].push_back({{"TEXCOORD_1", shift}, {"COLOR_0", green}, {"JOINTS_0", shift}});
  document.json["meshes"][0]["weights"] = Json::array({1});
  const Scene scene = load(document.json);
  EXPECT_EQ(scene.meshes[0].uvs[1][0], glm::vec2(0.5F, 2));
  EXPECT_EQ(scene.meshes[0].uvs[1][1], glm::vec2(1, 0));
  EXPECT_EQ(scene.meshes[0].colors[0], glm::vec4(0, 1, 0, 1));
  EXPECT_EQ(scene.meshes[0].colors[1], glm::vec4(1, 0, 1, 1)) << "brought into 0 to 1";
  EXPECT_TRUE(test::warns_of(scene, "JOINTS_0")) << "no attribute that targets move";
  document.primitive()["targets"] = Json::array({{{"TEXCOORD_1", green}}});
  EXPECT_THROW((void)load(document.json), Error);
}

TEST(GltfLoader, SkinsPutVerticesWhereTheirJointsAre) {
  auto document = triangle();
  document.primitive()["attributes"]["JOINTS_0"] =
      document.add(std::vector<std::uint8_t>{0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0}, "VEC4", 5121, 3);
  document.primitive()["attributes"]["WEIGHTS_0"] =
      document.add(std::vector<float>{1, 0, 0, 0, 1, 0, 0, 0, 0.5F, 0.5F, 0, 0}, "VEC4", 5126, 3);
  document.json["nodes"] = Json::array({{{"mesh", 0}, {"skin", 0}, {"translation", Json::array({100, 100, 100})}},
                                        {{"translation", Json::array({0, 0, 1})}},
                                        {{"translation", Json::array({0, 0, 3})}}});
  document.json["scenes"][0]["nodes"] = Json::array({0, 1, 2});
  document.json["skins"].push_back({{"joints", Json::array({1, 2})}});
  const Scene scene = load(document.json);
  EXPECT_EQ(scene.instances.at(0).to_world, glm::dmat4(1.0));
  const auto& positions = scene.meshes.at(0).positions;
  EXPECT_EQ(positions[0], glm::vec3(0, 0, 1));
  EXPECT_EQ(positions[1], glm::vec3(1, 0, 3));
  EXPECT_EQ(positions[2], glm::vec3(0, 1, 2));
}

TEST(GltfLoader, WeightsOfASkinThatDoNotAddUpToOneAreScaled) {
  auto document = triangle();
  document.primitive()["attributes"]["JOINTS_0"] =
      document.add(std::vector<std::uint8_t>{0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0}, "VEC4", 5121, 3);
  document.primitive()["attributes"]["WEIGHTS_0"] =
      document.add(std::vector<float>{1, 3, 0, 0, 0.25F, 0.25F, 0, 0, 0, 0.5F, 0, 0}, "VEC4", 5126, 3);
  document.json["nodes"] = Json::array({{{"mesh", 0}, {"skin", 0}},
                                        {{"translation", Json::array({0, 0, 0})}},
                                        {{"translation", Json::array({0, 0, 4})}}});
  document.json["scenes"][0]["nodes"] = Json::array({0, 1, 2});
  document.json["skins"].push_back({{"joints", Json::array({1, 2})}});
  const Scene scene = load(document.json);
  const auto& positions = scene.meshes.at(0).positions;
  EXPECT_EQ(positions[0], glm::vec3(0, 0, 3));
  EXPECT_EQ(positions[1], glm::vec3(1, 0, 2));
  EXPECT_EQ(positions[2], glm::vec3(0, 1, 4));
}

TEST(GltfLoader, NormalsALittleOffUnitLengthAreMadeUnit) {
  auto document = triangle();
  document.primitive()["attributes"]["NORMAL"] = document.add_vec3({0, 0, 1.02F, 0, 0, 0.98F, 0, 0, 1});
  EXPECT_EQ(load(document.json).meshes[0].normals, std::vector<glm::vec3>(3, glm::vec3(0, 0, 1)));
}

TEST(GltfLoader, TheLeastNormalizedIntegerIsMinusOne) {
  auto document = triangle();
  const int normals =
      document.add(std::vector<std::int8_t>{0, 0, -128, 0, 0, 0, -127, 0, 0, 0, 127, 0}, "VEC3", 5120, 3);
  document.json["accessors"][static_cast<std::size_t>(normals)]["normalized"] = true;
  document.json["bufferViews"][static_cast<std::size_t>(normals)]["byteStride"] = 4;
  document.json["extensionsUsed"] = Json::array({"KHR_mesh_quantization"});
  document.primitive()["attributes"]["NORMAL"] = normals;
  const int uv = document.add(std::vector<std::int8_t>{-128, 127, 0, 0, 0, 127, 0, 0, -127, 0, 0, 0}, "VEC2", 5120, 3);
  document.json["accessors"][static_cast<std::size_t>(uv)]["normalized"] = true;
  document.json["bufferViews"][static_cast<std::size_t>(uv)]["byteStride"] = 4;
  document.primitive()["attributes"]["TEXCOORD_0"] = uv;
  const Scene scene = load(document.json);
  EXPECT_EQ(scene.meshes[0].uvs[0][0], glm::vec2(-1, 1));
  EXPECT_EQ(scene.meshes[0].uvs[0][2], glm::vec2(-1, 0));
  EXPECT_EQ(scene.meshes[0].normals[0], glm::vec3(0, 0, -1));
}

TEST(GltfLoader, ACameraUnderAShearStillHasAxesAtRightAngles) {
  auto document = triangle();
  document.json["cameras"].push_back({{"type", "perspective"}, {"perspective", {{"yfov", 0.6}, {"znear", 0.1}}}});
  document.json["nodes"].push_back(
      {{"camera", 0}, {"matrix", Json::array({1, 0, 0, 0, 0.5, 2, 1, 0, 0, 0, 3, 0, 0, 0, 0, 1})}});
  document.json["scenes"][0]["nodes"] = Json::array({0, 1});
  const glm::dmat3 axes = load(document.json).cameras.at(0).axes;
  EXPECT_NEAR(glm::distance(axes[2], glm::dvec3(0, 0, 1)), 0.0, 1e-12) << "where it looks stays";
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) EXPECT_NEAR(glm::dot(axes[i], axes[j]), i == j ? 1.0 : 0.0, 1e-12) << i << j;
  }
  EXPECT_GT(axes[1].y, 0.9);
}

TEST(GltfLoader, TextureTransformsFollowTheExampleOfTheExtension) {
  auto document = triangle();
  // A 1 x 1 picture: an 8-bit RGB PNG.
  document.json["images"].push_back(
      {{"uri",
        "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGP4z8AAAAMBAQDJ/pLvAAAAAElF"
        "TkSuQmCC"}});
  document.json["textures"].push_back({{"source", 0}});
  document.primitive()["attributes"]["TEXCOORD_0"] = document.add_vec2({0, 0, 1, 0, 0, 1});
  document.json["materials"] = Json::parse(R"([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "extensions":
    {"KHR_texture_transform": {"offset": [0, 1], "rotation": 1.57079632679, "scale": [0.5, 0.5]}}}}}])");
  document.primitive()["material"] = 0;
  const Scene scene = load(document.json);
  ASSERT_TRUE(scene.materials[0].base_color_texture.present()) << (scene.warnings.empty() ? "" : scene.warnings[0]);
  const auto& [a, b, c, d, e, f] = scene.materials[0].base_color_texture.transform;
  // The extension's text: "only the lower left quadrant of the source image, rotated clockwise".
  for (const glm::vec2 uv : {glm::vec2(0, 0), glm::vec2(1, 0), glm::vec2(0, 1), glm::vec2(1, 1)}) {
    const float u = a * uv.x + c * uv.y + e;
    const float v = b * uv.x + d * uv.y + f;
    EXPECT_GE(u, -1e-6F);
    EXPECT_LE(u, 0.5F + 1e-6F);
    EXPECT_GE(v, 0.5F - 1e-6F);
    EXPECT_LE(v, 1.0F + 1e-6F);
  }
}

TEST(GltfLoader, ABrokenPictureIsLeftOutWithAWarning) {
  auto document = triangle();
  document.json["images"].push_back({{"uri", "data:image/png;base64,AAAA"}});
  document.json["textures"].push_back({{"source", 0}});
  document.primitive()["attributes"]["TEXCOORD_0"] = document.add_vec2({0, 0, 1, 0, 0, 1});
  document.json["materials"].push_back({{"emissiveTexture", {{"index", 0}}}});
  document.primitive()["material"] = 0;
  const Scene scene = load(document.json);
  EXPECT_FALSE(scene.materials[0].emissive_texture.present());
  EXPECT_TRUE(test::warns_of(scene, "images[0]"));
}

TEST(GltfLoader, WhatLiesTooFarOutIsLeftOutWithAWarning) {
  auto document = triangle();
  document.node()["scale"] = Json::array({1e30, 1e30, 1e30});
  const Scene scene = load(document.json);
  EXPECT_TRUE(scene.instances.empty());
  EXPECT_TRUE(test::warns_of(scene, "1e18"));
}

}  // namespace
}  // namespace hpr
