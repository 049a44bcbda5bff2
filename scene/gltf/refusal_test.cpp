#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <string>

#include "scene/gltf/test_tools.h"

namespace hpr {
namespace {

using test::refusal;
using test::triangle;

/// Expects exit code 3 and that the message names the place.
void expect_refused(const Json& document, const std::string& where) {
  const test::Refusal found = refusal(document);
  EXPECT_EQ(found.code, ExitCode::BadInput) << where << ": " << found.message;
  EXPECT_NE(found.message.find(where), std::string::npos) << found.message;
}

TEST(GltfRefusal, TheDocumentsTheseTestsBreakAreSound) {
  EXPECT_EQ(refusal(triangle().json).code, ExitCode::Done);
  EXPECT_TRUE(test::load(triangle().json).warnings.empty());
}

TEST(GltfRefusal, VersionsThatNeedMoreThanGltf20AreRefused) {
  for (const char* bad : {"2.1", "2.01", "2.10", "2.9", "3.0", "1.0"}) {
    auto document = triangle();
    document.json["asset"]["version"] = "2.1";
    document.json["asset"]["minVersion"] = bad;
    expect_refused(document.json, "asset.minVersion");
  }
  auto document = triangle();
  document.json["asset"]["version"] = "2.1";
  EXPECT_EQ(refusal(document.json).code, ExitCode::Done) << "readers of 2.0 read 2.1";
  document.json["asset"]["minVersion"] = "2.0";
  EXPECT_EQ(refusal(document.json).code, ExitCode::Done);
}

TEST(GltfRefusal, AccessorsThatLeaveTheirViewByOneByteAreRefused) {
  auto document = triangle();
  document.json["accessors"][0]["byteOffset"] = 1;
  expect_refused(document.json, "accessors[0]");
  document = triangle();
  document.json["accessors"][0]["count"] = 4;
  expect_refused(document.json, "accessors[0]");
  document = triangle();
  document.json["bufferViews"][0]["byteStride"] = 16;
  expect_refused(document.json, "accessors[0]");
  document = triangle();
  document.json["bufferViews"][0]["byteOffset"] = 1;
  expect_refused(document.json, "bufferViews[0]");
}

TEST(GltfRefusal, SumsThatWrapAroundAreRefused) {
  // 12 * (2^62 / 3 + 1) wraps to a small number in 64 bits, so JSON's exact integers end before.
  for (const Json& count : {Json(std::uint64_t{1} << 52), Json(std::numeric_limits<std::uint64_t>::max()), Json(1e30),
                            Json(-1), Json(0), Json(2.5), Json("3"), Json(true), Json(nullptr)}) {
    auto document = triangle();
    document.json["accessors"][0]["count"] = count;
    expect_refused(document.json, "accessors[0]");
  }
}

TEST(GltfRefusal, WholeNumbersMayBeWrittenAsReals) {
  auto document = triangle();
  document.json["accessors"][0]["count"] = 3.0;
  document.json["nodes"][0]["mesh"] = 0.0;
  EXPECT_EQ(test::load(document.json).triangles, 1U);
}

TEST(GltfRefusal, IndicesPastTheVerticesAreRefused) {
  auto document = triangle();
  document.primitive()["indices"] = document.add_indices({0, 1, 3});
  expect_refused(document.json, "meshes[0].primitives[0].indices");
}

TEST(GltfRefusal, ReferencesToNothingAreRefused) {
  for (const Json& bad : {Json(1), Json(-1), Json("0"), Json(1e9), Json(nullptr), Json(0.5)}) {
    auto document = triangle();
    document.json["nodes"][0]["mesh"] = bad;
    expect_refused(document.json, "nodes[0].mesh");
    document = triangle();
    document.primitive()["attributes"]["POSITION"] = bad;
    expect_refused(document.json, "meshes[0].primitives[0].attributes.POSITION");
    document = triangle();
    document.json["scenes"][0]["nodes"][0] = bad;
    expect_refused(document.json, "scenes[0].nodes[0]");
    document = triangle();
    document.primitive()["material"] = bad;
    expect_refused(document.json, "meshes[0].primitives[0].material");
  }
}

TEST(GltfRefusal, NodesFormTrees) {
  auto document = triangle();
  document.json["nodes"] = Json::parse(R"([{"mesh": 0}, {"children": [2]}, {"children": [1]}])");
  document.json["scenes"][0]["nodes"] = Json::array({0, 1});
  expect_refused(document.json, "nodes[1]");
  document.json["scenes"][0]["nodes"] = Json::array({0});
  EXPECT_TRUE(test::warns_of(test::load(document.json), "nodes[1]: is its own ancestor"));
  document.json["nodes"] = Json::parse(R"([{"children": [0]}])");
  expect_refused(document.json, "nodes[0]");
  document.json["nodes"] = Json::parse(R"([{"children": [1, 2]}, {"children": [2]}, {"mesh": 0}])");
  expect_refused(document.json, "nodes[1].children");
}

TEST(GltfRefusal, PositionsThatAreNotFiniteAreRefused) {
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    test::Document document;
    document.primitive()["attributes"]["POSITION"] = document.add_vec3({0, 0, 0, 1, bad, 0, 0, 1, 0});
    expect_refused(document.json, "POSITION");
  }
}

TEST(GltfRefusal, ProjectiveMatricesAreRefused) {
  auto document = triangle();
  document.node()["matrix"] = Json::array({1, 0, 0, 0.1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1});
  expect_refused(document.json, "nodes[0].matrix");
}

TEST(GltfRefusal, UnknownRequiredExtensionsAreNamed) {
  auto document = triangle();
  document.json["extensionsUsed"] = Json::array({"XYZ_unheard_of"});
  EXPECT_TRUE(test::warns_of(test::load(document.json), "XYZ_unheard_of"));
  document.json["extensionsRequired"] = Json::array({"XYZ_unheard_of"});
  expect_refused(document.json, "XYZ_unheard_of");
}

TEST(GltfRefusal, MaterialsWarnOfExtensionsThatAreNotDrawnDeclaredOrNot) {
  auto document = triangle();
  document.json["materials"].push_back({{"extensions", {{"KHR_materials_subsurface", {{"scatterDistance", 1}}}}}});
  document.json["materials"].push_back(document.json["materials"][0]);
  EXPECT_TRUE(test::warns_of(test::load(document.json), "materials: KHR_materials_subsurface"));
  EXPECT_EQ(test::load(document.json).warnings.size(), 1U) << "once for all materials";
  document.json["materials"] = Json::array({{{"extensions", {{"KHR_materials_ior", {{"ior", 1.4}}}}}}});
  EXPECT_TRUE(test::load(document.json).warnings.empty());
  document.json["extensionsUsed"] = Json::array({"KHR_materials_ior"});
  EXPECT_TRUE(test::load(document.json).warnings.empty());
}

TEST(GltfRefusal, UnknownCompressionsAreRefusedWithTheToolThatUnpacksThem) {
  auto document = triangle();
  document.json["extensionsUsed"] = Json::array({"XYZ_mesh_compression"});
  document.json["extensionsRequired"] = Json::array({"XYZ_mesh_compression"});
  expect_refused(document.json, "XYZ_mesh_compression");
  EXPECT_NE(refusal(document.json).hint.find("gltf-transform"), std::string::npos);
}

TEST(GltfRefusal, SparseAccessorsStayInsideTheirAccessor) {
  auto document = triangle();
  const int where = document.add_indices({3});
  const int what = document.add_vec3({5, 5, 5});
  document.json["accessors"][0]["sparse"] = {
      {"count", 1}, {"indices", {{"bufferView", where}, {"componentType", 5123}}}, {"values", {{"bufferView", what}}}};
  expect_refused(document.json, "accessors[0].sparse.indices");
  document.json["accessors"][0]["sparse"]["values"]["byteOffset"] = 1;
  expect_refused(document.json, "accessors[0].sparse.values");
}

TEST(GltfRefusal, InstancesBeyondTheMemoryLimitAreALimit) {
  auto document = triangle();
  constexpr std::size_t kCount = 1000;
  const int translation = document.add_vec3(std::vector<float>(3 * kCount, 1.0F));
  document.node()["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"] = translation;
  EXPECT_EQ(test::load(document.json).triangles, kCount);
  SceneLimits limits;
  limits.memory_bytes = kCount * sizeof(Instance);
  EXPECT_EQ(refusal(document.json, limits).code, ExitCode::Limit);
}

TEST(GltfRefusal, ZerosWithoutDataCannotFillTheMemory) {
  auto document = triangle();
  document.json["accessors"][0].erase("bufferView");
  document.json["accessors"][0]["count"] = 1'000'000'000;
  EXPECT_EQ(refusal(document.json).code, ExitCode::Limit);
}

TEST(GltfRefusal, BrokenJsonIsShownWithItsLine) {
  const test::TemporaryFolder folder;
  const auto path = folder.write("x.gltf", "{\"asset\": {\"version\": \"2.0\"},\n \"nodes\": [}\n");
  try {
    (void)load_gltf(path, {});
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("x.gltf:2:12"), std::string::npos) << error.what();
    EXPECT_EQ(error.line(), " \"nodes\": [}");
  }
}

}  // namespace
}  // namespace hpr
