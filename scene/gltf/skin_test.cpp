#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "scene/gltf/test_tools.h"

namespace hpr {
namespace {

using test::load;
using test::refusal;
using test::triangle;
using test::warns_of;

/// The joints and weights of a vertex in sets of four, and where its blended joints move it along x. Joint k moves by
/// 2^k metres, so a blend moves by the sum of weight times 2^k over the sum of weights.
struct SkinCase {
  std::vector<std::array<std::uint8_t, 4>> joints;
  std::vector<std::array<float, 4>> weights;
  float moved;
};
const std::array<SkinCase, 20> kSkinCases{{
    {{{0, 0, 0, 0}}, {{1, 0, 0, 0}}, 1},
    {{{3, 0, 0, 0}}, {{1, 0, 0, 0}}, 8},
    {{{0, 1, 2, 3}}, {{0.25F, 0.25F, 0.25F, 0.25F}}, 3.75F},
    {{{0, 1, 2, 3}, {4, 0, 0, 0}}, {{0, 0, 0, 0}, {1, 0, 0, 0}}, 16},
    {{{0, 1, 2, 3}, {4, 5, 6, 7}}, {{0, 0, 0, 0}, {0, 0, 0, 1}}, 128},
    {{{0, 1, 2, 3}, {4, 5, 6, 7}}, {{0.5F, 0, 0, 0}, {0.5F, 0, 0, 0}}, 8.5F},
    {{{0, 1, 2, 3}, {4, 5, 6, 7}}, {{0.125F, 0.125F, 0.125F, 0.125F}, {0.125F, 0.125F, 0.125F, 0.125F}}, 31.875F},
    {{{7, 6, 5, 4}, {3, 2, 1, 0}}, {{0.125F, 0.125F, 0.125F, 0.125F}, {0.125F, 0.125F, 0.125F, 0.125F}}, 31.875F},
    {{{0, 0, 0, 0}, {1, 1, 1, 1}}, {{0.125F, 0.125F, 0.125F, 0.125F}, {0.125F, 0.125F, 0.125F, 0.125F}}, 1.5F},
    {{{5, 0, 0, 0}, {5, 0, 0, 0}}, {{0.5F, 0, 0, 0}, {0.5F, 0, 0, 0}}, 32},
    {{{2, 3, 0, 0}, {4, 0, 0, 0}}, {{0.25F, 0.5F, 0, 0}, {0.25F, 0, 0, 0}}, 9},
    {{{2, 3, 0, 0}, {4, 0, 0, 0}}, {{0.5F, 1, 0, 0}, {0.5F, 0, 0, 0}}, 9},
    {{{2, 3, 0, 0}, {4, 0, 0, 0}}, {{1, 2, 0, 0}, {1, 0, 0, 0}}, 9},
    {{{0, 1, 2, 3}, {4, 5, 6, 7}}, {{0.5F, 0.25F, 0.125F, 0.0625F}, {0.0625F, 0, 0, 0}}, 3},
    {{{6, 0, 0, 0}, {7, 0, 0, 0}}, {{0.75F, 0, 0, 0}, {0.25F, 0, 0, 0}}, 80},
    {{{1, 2, 0, 0}, {0, 0, 0, 3}}, {{0.25F, 0.25F, 0, 0}, {0, 0, 0, 0.5F}}, 5.5F},
    {{{0, 1, 2, 3}, {4, 5, 6, 7}, {8, 0, 0, 0}}, {{0, 0, 0, 0}, {0, 0, 0, 0}, {1, 0, 0, 0}}, 256},
    {{{0, 0, 0, 0}, {4, 0, 0, 0}, {8, 0, 0, 0}}, {{0.5F, 0, 0, 0}, {0.25F, 0, 0, 0}, {0.25F, 0, 0, 0}}, 68.5F},
    {{{0, 0, 0, 0}, {1, 0, 0, 0}, {2, 0, 0, 0}, {3, 0, 0, 0}},
     {{0.25F, 0, 0, 0}, {0.25F, 0, 0, 0}, {0.25F, 0, 0, 0}, {0.25F, 0, 0, 0}},
     3.75F},
    {{{8, 0, 0, 0}, {0, 0, 0, 8}}, {{0.5F, 0, 0, 0}, {0.25F, 0, 0, 0.25F}}, 192.25F},
}};

constexpr std::size_t kJoints = 9;

/// A triangle whose vertices all have the case's joints, and a node per joint.
test::Document skinned(const SkinCase& one) {
  auto document = triangle();
  for (std::size_t set = 0; set < one.joints.size(); ++set) {
    std::vector<std::uint8_t> joints;
    std::vector<float> weights;
    for (int vertex = 0; vertex < 3; ++vertex) {
      joints.insert(joints.end(), one.joints[set].begin(), one.joints[set].end());
      weights.insert(weights.end(), one.weights[set].begin(), one.weights[set].end());
    }
    const int joints_accessor = document.add(joints, "VEC4", 5121, 3);
    const int weights_accessor = document.add(weights, "VEC4", 5126, 3);
    document.primitive()["attributes"]["JOINTS_" + std::to_string(set)] = joints_accessor;
    document.primitive()["attributes"]["WEIGHTS_" + std::to_string(set)] = weights_accessor;
  }
  document.json["skins"].push_back({{"joints", Json::array()}});
  for (std::size_t k = 0; k < kJoints; ++k) {
    document.json["skins"][0]["joints"].push_back(k + 1);
    document.json["nodes"].push_back({{"translation", Json::array({1U << k, 0, 0})}});
  }
  document.node()["skin"] = 0;
  return document;
}

TEST(GltfSkin, VerticesFollowAllOfTheirJointsHoweverManySetsThereAre) {
  for (std::size_t i = 0; i < kSkinCases.size(); ++i) {
    const Scene scene = load(skinned(kSkinCases[i]).json);
    EXPECT_TRUE(scene.warnings.empty()) << i << ": " << scene.warnings.front();
    const float moved = kSkinCases[i].moved;
    EXPECT_EQ(scene.meshes.at(0).positions, (std::vector<glm::vec3>{{moved, 0, 0}, {1 + moved, 0, 0}, {moved, 1, 0}}))
        << "case " << i;
  }
}

TEST(GltfSkin, TheFifthJointAlsoTurnsAndScales) {
  // Half of joint 0, which moves by 1 along x, and half of joint 4, which doubles and turns x to y: the vertex (1 0 0)
  // goes to (2 0 0) and (0 2 0), the mean of which is (1 1 0).
  auto document = skinned({{{0, 1, 2, 3}, {4, 0, 0, 0}}, {{0.5F, 0, 0, 0}, {0.5F, 0, 0, 0}}, 0});
  document.json["nodes"][5] = Json::parse(R"({"matrix": [0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1]})");
  const Mesh mesh = load(document.json).meshes.at(0);
  EXPECT_EQ(mesh.positions, (std::vector<glm::vec3>{{0.5F, 0, 0}, {1, 1, 0}, {-0.5F, 0.5F, 0}}));
}

TEST(GltfSkin, SetsWithoutTheirOtherHalfAreLeftOutWithAWarning) {
  for (const char* missing : {"JOINTS_1", "WEIGHTS_1"}) {
    auto document = skinned({{{0, 1, 2, 3}, {4, 0, 0, 0}}, {{1, 0, 0, 0}, {1, 0, 0, 0}}, 0});
    document.primitive()["attributes"].erase(missing);
    const Scene scene = load(document.json);
    EXPECT_TRUE(warns_of(scene, "only one of JOINTS_1 and WEIGHTS_1")) << missing;
    EXPECT_EQ(scene.meshes.at(0).positions.at(0), glm::vec3(1, 0, 0)) << missing;
  }
}

TEST(GltfSkin, JointsThatThereAreNotAreRefusedInEverySet) {
  const auto document = skinned({{{0, 1, 2, 3}, {9, 0, 0, 0}}, {{1, 0, 0, 0}, {1, 0, 0, 0}}, 0});
  const test::Refusal found = refusal(document.json);
  EXPECT_EQ(found.code, ExitCode::BadInput);
  EXPECT_NE(found.message.find("JOINTS_1: vertex 0 names joint 9 of 9"), std::string::npos) << found.message;
}

}  // namespace
}  // namespace hpr
