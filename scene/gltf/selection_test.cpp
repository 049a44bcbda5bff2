#include "scene/gltf/selection.h"

#include <gtest/gtest.h>

#include <array>
#include <string>
#include <vector>

#include "scene/gltf/test_tools.h"
#include "scene/load_scene.h"

namespace hpr {
namespace {

using test::load;
using test::triangle;
using test::warns_of;

/// What choosing from a document complains of.
test::Refusal refusal(const Json& json, const SceneChoice& choice) {
  try {
    (void)load(json, choice);
  } catch (const Error& error) {
    return {error.code(), error.what(), error.hint()};
  }
  return {};
}

std::vector<std::string> names_of_nodes(const Json& json, const SceneChoice& choice = {}) {
  return load(json, choice).node_names;
}

/// Three scenes of a node each: "hall", one without a name, and another "hall".
Json three_scenes() {
  Json json = triangle().json;
  json["nodes"] = Json::parse(R"([{"mesh": 0, "name": "a"}, {"mesh": 0, "name": "b"}, {"mesh": 0, "name": "c"}])");
  json["scenes"] = Json::parse(R"([{"nodes": [0], "name": "hall"}, {"nodes": [1]}, {"nodes": [2], "name": "hall"}])");
  json["scene"] = 1;
  return json;
}

TEST(GltfSelection, TheChosenSceneIsDrawnElseTheFilesOwnElseTheFirst) {
  Json json = three_scenes();
  const auto drawn = [&](const char* scene) { return names_of_nodes(json, {.scene = scene}).at(0); };
  EXPECT_EQ(drawn(""), "b");
  EXPECT_EQ(drawn("0"), "a");
  EXPECT_EQ(drawn("1"), "b");
  EXPECT_EQ(drawn("2"), "c");
  EXPECT_EQ(drawn("hall"), "a");
  EXPECT_EQ(drawn("scene1"), "b");
  json.erase("scene");
  EXPECT_EQ(drawn(""), "a");
  EXPECT_EQ(drawn("2"), "c");
  EXPECT_EQ(load(json).scenes, (std::vector<std::string>{"hall", "scene1", "hall"}));
  json["scenes"][0]["name"] = "2";
  EXPECT_EQ(drawn("2"), "a") << "names come before indices";
}

TEST(GltfSelection, ASceneThereIsNotIsAnErrorWithTheChoices) {
  for (const char* bad : {"3", "-1", "1.0", "01x", "halls", " 1", "999999999999999999999"}) {
    const test::Refusal found = refusal(three_scenes(), {.scene = bad});
    EXPECT_EQ(found.code, ExitCode::Usage) << bad;
    EXPECT_NE(found.message.find(std::string("the file has no scene '") + bad), std::string::npos) << found.message;
    EXPECT_NE(found.hint.find("hall, scene1, hall"), std::string::npos) << found.hint;
  }
  Json json = three_scenes();
  json.erase("scenes");
  json.erase("scene");
  EXPECT_EQ(refusal(json, {.scene = "0"}).code, ExitCode::Usage);
  EXPECT_EQ(names_of_nodes(json).size(), 3U);
}

TEST(GltfSelection, OnlyWhatTheChosenSceneUsesHasToBeRight) {
  Json json = three_scenes();
  json["nodes"][2]["mesh"] = 9;
  EXPECT_EQ(names_of_nodes(json, {.scene = "0"}).at(0), "a");
  EXPECT_EQ(refusal(json, {.scene = "2"}).code, ExitCode::BadInput);
}

TEST(GltfSelection, GeneratedScenesAreOneSceneWithoutVariants) {
  EXPECT_GT(load_scene("gen:cornell", {}, {.scene = "0"}).triangles, 0U);
  EXPECT_THROW((void)load_scene("gen:cornell", {}, {.scene = "1"}), Error);
  EXPECT_THROW((void)load_scene("gen:cornell", {}, {.variant = "red"}), Error);
}

/// A primitive, and the index of the material it has without a variant and with each of "v0" to "v3". There are five
/// materials; 5 is the default one.
struct VariantCase {
  const char* primitive;
  std::array<std::uint32_t, 5> material;
};
constexpr std::array<VariantCase, 20> kVariantCases{{
    {R"({"material": 0})", {0, 0, 0, 0, 0}},
    {R"({})", {5, 5, 5, 5, 5}},
    {R"({"material": 0, "mappings": []})", {0, 0, 0, 0, 0}},
    {R"({"material": 0, "mappings": [{"variants": [0], "material": 1}]})", {0, 1, 0, 0, 0}},
    {R"({"material": 0, "mappings": [{"variants": [1], "material": 2}]})", {0, 0, 2, 0, 0}},
    {R"({"material": 0, "mappings": [{"variants": [3], "material": 4}]})", {0, 0, 0, 0, 4}},
    {R"({"material": 0, "mappings": [{"variants": [0, 1], "material": 3}]})", {0, 3, 3, 0, 0}},
    {R"({"material": 0, "mappings": [{"variants": [3, 0], "material": 3}]})", {0, 3, 0, 0, 3}},
    {R"({"material": 4, "mappings": [{"variants": [0, 1, 2, 3], "material": 1}]})", {4, 1, 1, 1, 1}},
    {R"({"mappings": [{"variants": [2], "material": 1}]})", {5, 5, 5, 1, 5}},
    {R"({"mappings": [{"variants": [0, 1, 2, 3], "material": 0}]})", {5, 0, 0, 0, 0}},
    {R"({"material": 0, "mappings": [{"variants": [0], "material": 1}, {"variants": [1], "material": 2}]})",
     {0, 1, 2, 0, 0}},
    {R"({"material": 0, "mappings": [{"variants": [1], "material": 1}, {"variants": [0], "material": 2}]})",
     {0, 2, 1, 0, 0}},
    {R"({"material": 1, "mappings": [{"variants": [0, 2], "material": 2}, {"variants": [1, 3], "material": 3}]})",
     {1, 2, 3, 2, 3}},
    {R"({"material": 2, "mappings": [{"variants": [0], "material": 2}]})", {2, 2, 2, 2, 2}},
    {R"({"material": 2, "mappings": [{"variants": [], "material": 4}]})", {2, 2, 2, 2, 2}},
    {R"({"material": 3, "mappings": [{"variants": [2.0], "material": 4.0}]})", {3, 3, 3, 4, 3}},
    {R"({"material": 0, "mappings": [{"variants": [1], "material": 1}, {"variants": [1], "material": 2}]})",
     {0, 0, 1, 0, 0}},
    {R"({"material": 0, "mappings": [{"variants": [0], "material": 4, "name": "x", "extras": {"material": 1}}]})",
     {0, 4, 0, 0, 0}},
    {R"({"material": 4, "mappings": [{"variants": [0], "material": 0}, {"variants": [1], "material": 1},
        {"variants": [2], "material": 2}, {"variants": [3], "material": 3}]})",
     {4, 0, 1, 2, 3}},
}};

constexpr const char* kVariantsKey = "KHR_materials_variants";

/// A mesh of a triangle for each primitive, whose mappings move to where the extension has them.
Json with_variants(const std::vector<Json>& primitives) {
  Json json = triangle().json;
  json["extensionsUsed"] = Json::array({kVariantsKey});
  json["extensions"][kVariantsKey]["variants"] =
      Json::parse(R"([{"name": "v0"}, {"name": "v1"}, {"name": "v2"}, {"name": "v3"}])");
  json["materials"] =
      Json::parse(R"([{"name": "m0"}, {"name": "m1"}, {"name": "m2"}, {"name": "m3"}, {"name": "m4"}])");
  Json& list = json["meshes"][0]["primitives"];
  list = Json::array();
  for (Json primitive : primitives) {
    primitive["attributes"]["POSITION"] = 0;
    if (primitive.contains("mappings")) {
      const Json mappings = primitive["mappings"];
      primitive.erase("mappings");
      primitive["extensions"][kVariantsKey]["mappings"] = mappings;
    }
    list.push_back(primitive);
  }
  return json;
}

TEST(GltfSelection, PrimitivesHaveTheMaterialsOfTheChosenVariant) {
  std::vector<Json> primitives;
  for (const VariantCase& one : kVariantCases) primitives.push_back(Json::parse(one.primitive));
  const Json json = with_variants(primitives);
  constexpr std::array<const char*, 5> kNames{"", "v0", "v1", "v2", "v3"};
  for (std::size_t v = 0; v < kNames.size(); ++v) {
    const Scene scene = load(json, {.variant = kNames[v]});
    EXPECT_TRUE(scene.warnings.empty());
    ASSERT_EQ(scene.meshes.size(), kVariantCases.size());
    for (std::size_t i = 0; i < kVariantCases.size(); ++i) {
      EXPECT_EQ(scene.meshes[i].material, kVariantCases[i].material[v])
          << kNames[v] << ' ' << kVariantCases[i].primitive;
    }
    EXPECT_EQ(scene.variants, (std::vector<std::string>{"v0", "v1", "v2", "v3"}));
  }
}

TEST(GltfSelection, AVariantThereIsNotIsAnErrorWithTheChoices) {
  const Json json = with_variants({Json::parse(R"({"material": 0})")});
  const test::Refusal found = refusal(json, {.variant = "v9"});
  EXPECT_EQ(found.code, ExitCode::Usage);
  EXPECT_NE(found.message.find("the file has no variant 'v9'"), std::string::npos) << found.message;
  EXPECT_NE(found.hint.find("v0, v1, v2, v3"), std::string::npos) << found.hint;
  EXPECT_EQ(refusal(triangle().json, {.variant = "v0"}).code, ExitCode::Usage);
  EXPECT_EQ(refusal(json, {.variant = "0"}).code, ExitCode::Usage) << "variants have names alone";
}

TEST(GltfSelection, MappingsThatAreWrongMatterOnceAVariantIsChosen) {
  for (const char* bad : {
           R"({"material": 0, "mappings": 5})",
           R"({"material": 0, "mappings": [5]})",
           R"({"material": 0, "mappings": [{"variants": 0, "material": 1}]})",
           R"({"material": 0, "mappings": [{"variants": [4], "material": 1}]})",
           R"({"material": 0, "mappings": [{"variants": [-1], "material": 1}]})",
           R"({"material": 0, "mappings": [{"material": 1}]})",
           R"({"material": 0, "mappings": [{"variants": [0]}]})",
           R"({"material": 0, "mappings": [{"variants": [0], "material": 5}]})",
           R"({"material": 0, "mappings": [{"variants": [0], "material": "m1"}]})",
       }) {
    const Json json = with_variants({Json::parse(bad)});
    EXPECT_EQ(refusal(json, {}).code, ExitCode::Done) << bad;
    EXPECT_EQ(refusal(json, {.variant = "v0"}).code, ExitCode::BadInput) << bad;
  }
}

TEST(GltfSelection, MaterialsOfOtherVariantsMayBeWrong) {
  Json json = with_variants({Json::parse(R"({"material": 0, "mappings": [{"variants": [1], "material": 1}]})")});
  json["materials"][1]["doubleSided"] = 5;
  EXPECT_TRUE(warns_of(load(json), "materials[1].doubleSided"));
  EXPECT_TRUE(warns_of(load(json, {.variant = "v0"}), "materials[1].doubleSided"));
  EXPECT_EQ(refusal(json, {.variant = "v1"}).code, ExitCode::BadInput);
}

/// Nodes of which all have a mesh, a light and a camera, and the ones that are drawn.
struct VisibilityCase {
  const char* nodes;  ///< "show" stands for the extension's value
  const char* roots;
  std::string drawn;  ///< a digit per node
};
const std::array<VisibilityCase, 20> kVisibilityCases{{
    {R"([{}])", "[0]", "0"},
    {R"([{"show": true}])", "[0]", "0"},
    {R"([{"show": false}])", "[0]", ""},
    {R"([{"show": false}, {}])", "[0, 1]", "1"},
    {R"([{}, {"show": false}])", "[0, 1]", "0"},
    {R"([{"show": false, "children": [1]}, {}])", "[0]", ""},
    {R"([{"show": false, "children": [1]}, {"show": true}])", "[0]", ""},
    {R"([{"show": true, "children": [1]}, {"show": false}])", "[0]", "0"},
    {R"([{"children": [1]}, {"show": false, "children": [2]}, {}])", "[0]", "0"},
    {R"([{"children": [1]}, {"show": false, "children": [2]}, {"show": true}])", "[0]", "0"},
    {R"([{"children": [1]}, {"children": [2]}, {"show": false}])", "[0]", "01"},
    {R"([{"children": [1, 2, 3]}, {}, {"show": false}, {}])", "[0]", "013"},
    {R"([{"children": [1, 2]}, {"show": false, "children": [3]}, {"children": [4]}, {}, {}])", "[0]", "024"},
    {R"([{"show": false, "children": [1]}, {"children": [2]}, {"children": [3]}, {"show": true}])", "[0]", ""},
    {R"([{"show": false, "children": [1]}, {}, {"children": [3]}, {}])", "[0, 2]", "23"},
    {R"([{"show": false}, {"show": false}, {"show": true}])", "[0, 1, 2]", "2"},
    {R"([{"children": [1]}, {}, {"show": false, "children": [3]}, {"children": [4]}, {}])", "[0, 2]", "01"},
    {R"([{"children": [0]}, {"show": false}])", "[1]", ""},
    // A node is as visible as all its ancestors, also those that the scene does not list.
    {R"([{"show": false, "children": [1]}, {}])", "[1]", ""},
    {R"([{"show": false, "children": [1]}, {}, {}])", "[1, 2]", "2"},
}};

TEST(GltfSelection, HiddenNodesHideTheirDescendantsAndLightsButNoCameras) {
  for (const VisibilityCase& one : kVisibilityCases) {
    Json json = triangle().json;
    json["extensionsUsed"] = Json::array({"KHR_node_visibility", "KHR_lights_punctual"});
    json["extensionsRequired"] = Json::array({"KHR_node_visibility"});
    json["extensions"]["KHR_lights_punctual"]["lights"] = Json::array({{{"type", "point"}}});
    json["cameras"].push_back({{"type", "perspective"}, {"perspective", {{"yfov", 0.8}, {"znear", 0.1}}}});
    json["nodes"] = Json::parse(one.nodes);
    json["scenes"][0]["nodes"] = Json::parse(one.roots);
    std::size_t index = 0;
    for (Json& node : json["nodes"].elements()) {
      node["name"] = std::to_string(index++);
      node["mesh"] = 0;
      node["camera"] = 0;
      node["extensions"]["KHR_lights_punctual"]["light"] = 0;
      const Json show = node["show"];
      if (!show.is_null()) node["extensions"]["KHR_node_visibility"]["visible"] = show;
    }
    const Scene scene = load(json);
    std::string drawn;
    for (const std::string& name : scene.node_names) drawn += name;
    EXPECT_EQ(drawn, one.drawn) << one.nodes;
    std::string lights;
    for (const Light& light : scene.lights) lights += light.name;
    EXPECT_EQ(lights, one.drawn) << one.nodes;
    EXPECT_EQ(scene.triangles, one.drawn.size()) << one.nodes;
    EXPECT_GE(scene.cameras.size(), json["scenes"][0]["nodes"].size()) << one.nodes;
  }
}

TEST(GltfSelection, VisibilityIsTrueOrFalse) {
  Json json = triangle().json;
  json["extensionsUsed"] = Json::array({"KHR_node_visibility"});
  Json& own = json["nodes"][0]["extensions"]["KHR_node_visibility"];
  own = Json::object();
  EXPECT_EQ(load(json).triangles, 1U) << "visible is true by default";
  for (const Json& bad : {Json(0), Json("false"), Json(nullptr)}) {
    own["visible"] = bad;
    EXPECT_EQ(refusal(json, {}).code, ExitCode::BadInput) << bad;
  }
}

}  // namespace
}  // namespace hpr
