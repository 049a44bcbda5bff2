#include "scene/gltf/usage.h"

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "scene/gltf/test_tools.h"

namespace hpr {
namespace {

using test::load;
using test::refusal;
using test::triangle;
using test::warns_of;

/// A triangle beside which stand things of every kind that it does not use.
test::Document with_spares() {
  auto document = triangle();
  Json& json = document.json;
  const int spare = document.add_vec3({0, 0, 0, 1, 0, 0, 0, 1, 0});
  json["accessors"][1]["min"] = json["accessors"][0]["min"];
  json["accessors"][1]["max"] = json["accessors"][0]["max"];
  json["meshes"].push_back({{"primitives", Json::array({{{"attributes", {{"POSITION", spare}}}, {"material", 0}}})}});
  json["materials"].push_back({{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}});
  json["textures"].push_back({{"source", 0}, {"sampler", 0}});
  json["samplers"].push_back({{"magFilter", 9728}});
  json["images"].push_back({{"uri", "data:image/png;base64,AAAA"}});
  json["cameras"].push_back({{"type", "perspective"}, {"perspective", {{"yfov", 0.8}, {"znear", 0.1}}}});
  json["extensionsUsed"] = Json::array({"KHR_lights_punctual"});
  json["extensions"]["KHR_lights_punctual"]["lights"] = Json::array({{{"type", "point"}}});
  json["skins"].push_back({{"joints", Json::array({1})}});
  json["animations"].push_back(Json::parse(
      R"({"samplers": [{"input": 1, "output": 1}], "channels": [{"sampler": 0, "target": {"node": 1, "path": "scale"}}]})"));
  json["nodes"].push_back(
      {{"mesh", 1}, {"skin", 0}, {"camera", 0}, {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  json["scenes"].push_back({{"nodes", Json::array({1})}});
  return document;
}

/// Something that is wrong with the spares, and where.
struct Fault {
  std::string where;
  std::function<void(Json&)> make;
};

std::vector<Fault> faults() {
  const auto perspective = [](Json& json) -> Json& { return json["cameras"][0]["perspective"]; };
  const auto light = [](Json& json) -> Json& { return json["extensions"]["KHR_lights_punctual"]["lights"][0]; };
  return {
      {"cameras[0].perspective.yfov", [=](Json& json) { perspective(json)["yfov"] = 4; }},
      {"cameras[0].perspective.zfar", [=](Json& json) { perspective(json)["zfar"] = 0.01; }},
      {"cameras[0].type", [](Json& json) { json["cameras"][0]["type"] = "fisheye"; }},
      {"cameras[0].type", [](Json& json) { json["cameras"][0].erase("type"); }},
      {"cameras[0]", [](Json& json) { json["cameras"][0] = 5; }},
      {"lights[0].type", [=](Json& json) { light(json)["type"] = "laser"; }},
      {"lights[0].type", [=](Json& json) { light(json).erase("type"); }},
      {"lights[0].color",
       [=](Json& json) {
         light(json)["color"] = Json::array({1, 1});
       }},
      {"lights[0].spot", [=](Json& json) { light(json)["type"] = "spot"; }},
      {"buffers[1]", [](Json& json) { json["buffers"][1]["uri"] = "missing.bin"; }},
      {"buffers[1]", [](Json& json) { json["buffers"][1]["uri"] = "../outside.bin"; }},
      {"buffers[1]", [](Json& json) { json["buffers"][1]["uri"] = "data:;base64,A"; }},
      {"buffers[1]", [](Json& json) { json["buffers"][1].erase("uri"); }},
      {"buffers[1]", [](Json& json) { json["buffers"][1]["byteLength"] = 37; }},
      {"buffers[1].byteLength", [](Json& json) { json["buffers"][1].erase("byteLength"); }},
      {"bufferViews[1]", [](Json& json) { json["bufferViews"][1]["byteOffset"] = 1; }},
      {"bufferViews[1].buffer", [](Json& json) { json["bufferViews"][1]["buffer"] = 2; }},
      {"bufferViews[1].byteStride", [](Json& json) { json["bufferViews"][1]["byteStride"] = 13; }},
      {"accessors[1]", [](Json& json) { json["accessors"][1]["count"] = 4; }},
      {"accessors[1].type", [](Json& json) { json["accessors"][1]["type"] = "VEC5"; }},
      {"accessors[1].componentType", [](Json& json) { json["accessors"][1]["componentType"] = 5124; }},
      {"accessors[1].bufferView", [](Json& json) { json["accessors"][1]["bufferView"] = 9; }},
      {"accessors[1]",
       [](Json& json) {
         json["accessors"][1].erase("bufferView");
         json["accessors"][1]["count"] = 1'000'000'000;
       }},
      {"meshes[1].primitives[0].attributes",
       [](Json& json) { json["meshes"][1]["primitives"][0]["attributes"] = Json::object(); }},
      {"meshes[1].primitives[0].material", [](Json& json) { json["meshes"][1]["primitives"][0]["material"] = 7; }},
      {"meshes[1].primitives[0].mode", [](Json& json) { json["meshes"][1]["primitives"][0]["mode"] = 7; }},
      {"meshes[1].primitives", [](Json& json) { json["meshes"][1].erase("primitives"); }},
      {"meshes[1].primitives[0].attributes.POSITION", [](Json& json) { json["accessors"][1]["type"] = "SCALAR"; }},
      {"materials[0].pbrMetallicRoughness.baseColorFactor",
       [](Json& json) {
         json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = Json::array({1, 1, 1});
       }},
      {"materials[0].doubleSided", [](Json& json) { json["materials"][0]["doubleSided"] = 1; }},
      {"materials[0].pbrMetallicRoughness.baseColorTexture.index",
       [](Json& json) { json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["index"] = 3; }},
      {"textures[0].source", [](Json& json) { json["textures"][0]["source"] = 1; }},
      {"samplers[0].wrapS", [](Json& json) { json["samplers"][0]["wrapS"] = "repeat"; }},
      {"images[0].uri", [](Json& json) { json["images"][0]["uri"] = 5; }},
      {"skins[0].joints", [](Json& json) { json["skins"][0]["joints"] = Json::array(); }},
      {"skins[0].inverseBindMatrices", [](Json& json) { json["skins"][0]["inverseBindMatrices"] = 1; }},
      {"nodes[1].mesh", [](Json& json) { json["nodes"][1]["mesh"] = 2; }},
      {"nodes[1].scale", [](Json& json) { json["nodes"][1]["scale"] = Json::array({1}); }},
      {"nodes[1].matrix",
       [](Json& json) {
         json["nodes"][1]["matrix"] = Json::array({1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1});
       }},
      {"nodes[1]", [](Json& json) { json["nodes"][1]["children"] = Json::array({1}); }},
      {"nodes[2].children",
       [](Json& json) {
         json["nodes"][1]["children"] = Json::array({3, 2});
         json["nodes"].push_back({{"children", Json::array({3})}});
         json["nodes"].push_back(Json::object());
       }},
  };
}

TEST(GltfUsage, TheSparesOfTheseTestsAreSound) {
  auto document = with_spares();
  EXPECT_EQ(refusal(document.json).message, "");
  document.json["scene"] = 1;
  EXPECT_EQ(refusal(document.json).message, "");
}

TEST(GltfUsage, WhatTheDrawnSceneDoesNotUseOnlyCausesWarnings) {
  for (const Fault& fault : faults()) {
    auto document = with_spares();
    fault.make(document.json);
    const test::Refusal found = refusal(document.json);
    ASSERT_EQ(found.code, ExitCode::Done) << fault.where << ": " << found.message;
    const Scene scene = load(document.json);
    EXPECT_EQ(scene.triangles, 1U) << fault.where;
    EXPECT_TRUE(warns_of(scene, fault.where)) << fault.where;
    EXPECT_TRUE(warns_of(scene, "the scene does not use it")) << fault.where;
  }
}

TEST(GltfUsage, WhatTheDrawnSceneUsesIsRefused) {
  for (const Fault& fault : faults()) {
    auto document = with_spares();
    document.json["scene"] = 1;
    fault.make(document.json);
    const test::Refusal found = refusal(document.json);
    EXPECT_NE(found.code, ExitCode::Done) << fault.where;
    EXPECT_NE(found.message.find(fault.where), std::string::npos) << fault.where << ": " << found.message;
  }
}

TEST(GltfUsage, AnimationsAreNotUsed) {
  auto document = with_spares();
  document.json["animations"][0]["channels"][0]["sampler"] = 4;
  EXPECT_TRUE(warns_of(load(document.json), "animations[0].channels[0].sampler"));
}

TEST(GltfUsage, ANodeThatAnotherSceneClaimsTooBelongsToTheDrawnOne) {
  // Node 2 is a child of node 0, of a scene that is not drawn, and of node 1.
  auto document = triangle();
  document.json["nodes"] = Json::parse(R"([{"translation": [5, 0, 0], "children": [2]},
      {"translation": [0, 7, 0], "children": [2]}, {"mesh": 0}])");
  document.json["scenes"] = Json::parse(R"([{"nodes": [1]}, {"nodes": [0]}])");
  const Scene scene = load(document.json);
  EXPECT_TRUE(warns_of(scene, "node 2 is already a child of node 1"));
  ASSERT_EQ(scene.instances.size(), 1U);
  EXPECT_EQ(scene.instances[0].to_world[3], glm::dvec4(0, 7, 0, 1));
}

TEST(GltfUsage, ANodeThatIsARootAndAChildIsDrawnOnceAsTheChild) {
  const auto placed = [](const char* nodes, const Json& roots) {
    auto document = triangle();
    document.json["nodes"] = Json::parse(nodes);
    document.json["scenes"][0]["nodes"] = roots;
    const Scene scene = load(document.json);
    std::vector<double> x;
    for (const Instance& instance : scene.instances) x.push_back(instance.to_world[3].x);
    EXPECT_EQ(scene.warnings.size(), 1U) << roots;
    return x;
  };
  const char* const chain = R"([{"translation": [1, 0, 0], "children": [1]}, {"translation": [10, 0, 0], "mesh": 0,
      "children": [2]}, {"translation": [100, 0, 0], "mesh": 0}])";
  EXPECT_EQ(placed(chain, Json::array({0, 1})), (std::vector<double>{11, 111}));
  EXPECT_EQ(placed(chain, Json::array({1, 0})), (std::vector<double>{11, 111}));
  EXPECT_EQ(placed(chain, Json::array({0, 2})), (std::vector<double>{11, 111}));
  // Its parent is in no scene and places it all the same (glTF 2.0, section 3.5.3).
  EXPECT_EQ(placed(chain, Json::array({1})), (std::vector<double>{11, 111}));
  EXPECT_EQ(placed(chain, Json::array({2})), (std::vector<double>{111}));
  EXPECT_EQ(placed(chain, Json::array({0, 0})), (std::vector<double>{11, 111}));
}

TEST(GltfUsage, WhatOnlyPlacesOthersIsUsedAndItsContentsAreNot) {
  // Node 1, the parent of the joint 2, holds a mesh that is wrong, in no scene.
  auto document = triangle();
  const int joints = document.add(std::vector<std::uint8_t>(12, 0), "VEC4", 5121, 3);
  const int weights = document.add(std::vector<float>{1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, "VEC4", 5126, 3);
  document.primitive()["attributes"]["JOINTS_0"] = joints;
  document.primitive()["attributes"]["WEIGHTS_0"] = weights;
  document.json["skins"] = Json::parse(R"([{"joints": [2]}])");
  document.json["meshes"].push_back({{"primitives", 5}});
  document.json["nodes"] = Json::parse(R"([{"mesh": 0, "skin": 0}, {"mesh": 1, "translation": [3, 0, 0],
      "children": [2]}, {"translation": [0, 4, 0]}])");
  const Scene scene = load(document.json);
  EXPECT_TRUE(warns_of(scene, "meshes[1].primitives"));
  EXPECT_EQ(scene.meshes.at(0).positions.at(0), glm::vec3(3, 4, 0));
  document.json["nodes"][1]["translation"] = Json::array({1});
  EXPECT_NE(refusal(document.json).message.find("nodes[1].translation"), std::string::npos);
}

TEST(GltfUsage, FollowsReferencesOfExtensionsAndSparseAccessors) {
  const Json document = Json::parse(R"({"scenes": [{"nodes": [0]}],
      "nodes": [{"mesh": 1, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"SCALE": 2}}}}],
      "meshes": [{}, {"primitives": [{"attributes": {"POSITION": 0}, "indices": 1.0, "targets": [{"NORMAL": 3}],
          "extras": {"material": 0}}]}],
      "materials": [{}],
      "accessors": [{"sparse": {"indices": {"bufferView": 1, "byteOffset": 4}, "values": {"bufferView": 2}}}, {}, {}, {},
          {"bufferView": 3}],
      "bufferViews": [{}, {"buffer": 1}, {"extensions": {"ANY_compression": {"buffer": 2}}}, {"buffer": 3}],
      "buffers": [{}, {}, {}, {}]})");
  const GltfUsage usage = usage_of(document, 0);
  const auto used = [&](const char* section) {
    std::string list;
    for (std::size_t i = 0; i < document[section].size(); ++i) list += usage.contains(section, i) ? '1' : '0';
    return list;
  };
  EXPECT_EQ(used("nodes"), "1");
  EXPECT_EQ(used("meshes"), "01");
  EXPECT_EQ(used("materials"), "0");
  EXPECT_EQ(used("accessors"), "11110");
  EXPECT_EQ(used("bufferViews"), "0110");
  EXPECT_EQ(used("buffers"), "0110");
  EXPECT_FALSE(usage.contains("buffers", 100));
}

TEST(GltfUsage, AWrongViewOfNoBufferAtAllIsLeftOut) {
  Json json =
      Json::parse(R"({"asset": {"version": "2.0"}, "buffers": [], "bufferViews": [{"buffer": 7, "byteLength": 4}]})");
  EXPECT_EQ(refusal(json).message, "");
  EXPECT_TRUE(warns_of(load(json), "bufferViews[0].buffer"));
}

}  // namespace
}  // namespace hpr
