// Points and lines, as the file has them: their shapes are tested beside scene/points_lines.h.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "scene/gltf/gltf.h"
#include "scene/gltf/test_tools.h"

namespace hpr {
namespace {

using test::load;
using test::refusal;
using test::square;
using test::warns_of;

constexpr int kPoints = 0;
constexpr int kLines = 1;
constexpr int kLoop = 2;
constexpr int kStrip = 3;

/// The corners of a square as points or lines.
test::Document corners(int mode) {
  test::Document document = square();
  document.primitive()["mode"] = mode;
  return document;
}

TEST(GltfPoints, EachModeBecomesItsPointsOrSegments) {
  using Parts = std::vector<glm::uvec3>;
  const std::vector<Parts> expected{{{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {3, 3, 3}},
                                    {{0, 1, 1}, {2, 3, 3}},
                                    {{0, 1, 1}, {1, 2, 2}, {2, 3, 3}, {3, 0, 0}},
                                    {{0, 1, 1}, {1, 2, 2}, {2, 3, 3}}};
  const std::vector<Parts> indexed{
      {{3, 3, 3}, {0, 0, 0}, {2, 2, 2}}, {{3, 0, 0}}, {{3, 0, 0}, {0, 2, 2}, {2, 3, 3}}, {{3, 0, 0}, {0, 2, 2}}};
  for (const int mode : {kPoints, kLines, kLoop, kStrip}) {
    test::Document document = corners(mode);
    Scene scene = load(document.json);
    ASSERT_EQ(scene.meshes.size(), 1U);
    EXPECT_EQ(scene.meshes[0].kind, mode == kPoints ? MeshKind::Points : MeshKind::Lines);
    EXPECT_EQ(scene.meshes[0].triangles, expected.at(static_cast<std::size_t>(mode)));
    EXPECT_EQ(scene.bounds.high, glm::dvec3(1, 1, 0));
    EXPECT_TRUE(scene.warnings.empty());
    document.primitive()["indices"] = document.add_indices({3, 0, 2});
    scene = load(document.json);
    EXPECT_EQ(scene.meshes[0].triangles, indexed.at(static_cast<std::size_t>(mode)));
    EXPECT_EQ(warns_of(scene, "3 vertices make no whole number of lines"), mode == kLines);
  }
}

TEST(GltfPoints, TooFewVerticesMakeNoLine) {
  for (const int mode : {kLines, kLoop, kStrip}) {
    test::Document document = corners(mode);
    document.primitive()["indices"] = document.add_indices({2});
    const Scene scene = load(document.json);
    EXPECT_EQ(scene.triangles, 0U);
    EXPECT_TRUE(warns_of(scene, "1 vertices make no whole number of lines"));
  }
}

TEST(GltfPoints, WithoutNormalsTheyShowBaseColorAndEmissionWhateverTheLight) {
  test::Document document = corners(kPoints);
  document.json["materials"] = Json::parse(R"([{"doubleSided": true, "emissiveFactor": [0.25, 0, 1],
      "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 0.75, 0.5]}}])");
  document.primitive()["material"] = 0;
  Scene scene = load(document.json);
  ASSERT_EQ(scene.materials.size(), 2U);
  EXPECT_FALSE(scene.materials[0].unlit);
  EXPECT_EQ(scene.meshes[0].material, 1U);
  EXPECT_TRUE(scene.materials[1].unlit);
  EXPECT_EQ(scene.materials[1].base_color, glm::vec4(0.75F, 0.25F, 1.0F, 0.5F));
  EXPECT_EQ(scene.materials[1].emissive, glm::vec3(0.0F));

  const int normals = document.add_vec3({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1});
  document.primitive()["attributes"]["NORMAL"] = normals;
  scene = load(document.json);
  EXPECT_EQ(scene.materials.size(), 1U) << "with normals they take light";
  EXPECT_EQ(scene.meshes[0].material, 0U);

  document = corners(kStrip);  // the material that stands in where none is named
  scene = load(document.json);
  ASSERT_EQ(scene.materials.size(), 2U);
  EXPECT_TRUE(scene.materials[scene.meshes[0].material].unlit);
  EXPECT_FALSE(scene.materials[0].unlit);
}

TEST(GltfPoints, KeepTheirColorsAndTextureCoordinates) {
  test::Document document = corners(kPoints);
  document.primitive()["attributes"]["COLOR_0"] = document.add_vec3({1, 0, 0, 0, 1, 0, 0, 0, 1, 2, 0.5F, 0});
  document.primitive()["attributes"]["TEXCOORD_0"] = document.add_vec2({0, 0, 1, 0, 1, 1, 0, 1});
  const Scene scene = load(document.json);
  EXPECT_EQ(scene.meshes[0].colors[1], glm::vec4(0, 1, 0, 1));
  EXPECT_EQ(scene.meshes[0].colors[3], glm::vec4(1, 0.5F, 0, 1)) << "brought into 0 to 1";
  EXPECT_EQ(scene.meshes[0].uvs[0][3], glm::vec2(0, 1));
}

TEST(GltfPoints, AreMovedByMorphTargetsAndJoints) {
  test::Document document = corners(kPoints);
  document.primitive()["targets"] =
      Json::array({Json{{"POSITION", document.add_vec3({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 3})}}});
  document.json["meshes"][0]["weights"] = Json::array({0.5});
  Scene scene = load(document.json);
  EXPECT_EQ(scene.meshes[0].positions[3], glm::vec3(0, 1, 1.5F));

  document = corners(kStrip);
  const std::vector<std::uint8_t> joints(16, 0);
  document.primitive()["attributes"]["JOINTS_0"] = document.add(joints, "VEC4", 5121, 4);
  document.primitive()["attributes"]["WEIGHTS_0"] =
      document.add(std::vector<float>{1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, "VEC4", 5126, 4);
  document.json["nodes"].push_back({{"translation", Json::array({0, 0, 7})}});
  document.json["scenes"][0]["nodes"].push_back(1);
  document.json["skins"] = Json::array({Json{{"joints", Json::array({1})}}});
  document.node()["skin"] = 0;
  scene = load(document.json);
  EXPECT_EQ(scene.meshes[0].positions[2], glm::vec3(1, 1, 7));
}

TEST(GltfPoints, SparseAndQuantizedPositionsAreRead) {
  test::Document document = corners(kPoints);
  const auto indices = static_cast<std::size_t>(document.add_indices({2}));
  const auto values = static_cast<std::size_t>(document.add_vec3({9, 8, 7}));
  document.json["accessors"][0]["sparse"] = {
      {"count", 1},
      {"indices", {{"bufferView", document.json["accessors"][indices]["bufferView"]}, {"componentType", 5123}}},
      {"values", {{"bufferView", document.json["accessors"][values]["bufferView"]}}}};
  EXPECT_EQ(load(document.json).meshes[0].positions[2], glm::vec3(9, 8, 7));

  document = test::Document();
  document.json["extensionsUsed"] = Json::array({"KHR_mesh_quantization"});
  document.json["extensionsRequired"] = Json::array({"KHR_mesh_quantization"});
  const int packed = document.add(std::vector<std::int16_t>{32767, 0, -32767, 0}, "VEC3", 5122, 1);
  document.json["accessors"][static_cast<std::size_t>(packed)]["normalized"] = true;
  document.primitive()["attributes"]["POSITION"] = packed;
  document.primitive()["mode"] = kPoints;
  EXPECT_EQ(load(document.json).meshes[0].positions[0], glm::vec3(1, 0, -1));
}

TEST(GltfPoints, AreRefusedAsTrianglesAre) {
  for (const int mode : {kPoints, kStrip}) {
    test::Document document = corners(mode);
    document.primitive()["indices"] = document.add_indices({0, 4});
    EXPECT_EQ(refusal(document.json).code, ExitCode::BadInput);
    EXPECT_NE(refusal(document.json).message.find("index 1 is 4, but there are 4 vertices"), std::string::npos);

    document = corners(mode);
    document.primitive()["attributes"]["POSITION"] = document.add_vec3({0, 0, 0, 1, std::nanf(""), 0});
    EXPECT_EQ(refusal(document.json).code, ExitCode::BadInput);
    EXPECT_NE(refusal(document.json).message.find("vertex 1 is not finite"), std::string::npos);

    document = corners(mode);
    document.primitive()["attributes"] = Json{{"COLOR_0", document.add_vec3({1, 1, 1})}};
    EXPECT_TRUE(warns_of(load(document.json), "has no positions"));

    document = corners(mode);
    SceneLimits limits;
    limits.memory_bytes = 64;
    EXPECT_EQ(refusal(document.json, limits).code, ExitCode::Limit);
  }
}

}  // namespace
}  // namespace hpr
