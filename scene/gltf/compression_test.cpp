#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <string>

#include "scene/gltf/random_models.h"
#include "scene/gltf/test_tools.h"

namespace hpr {
namespace {

using test::expect_same_scene;
using test::load;
using test::random_model;
using test::refusal;

constexpr std::uint32_t kModels = 20;
constexpr const char* kMeshopt = "EXT_meshopt_compression";
constexpr const char* kDraco = "KHR_draco_mesh_compression";

/// The model of a seed as `write` compresses it is that which is not compressed.
template <typename Write>
void expect_same_models(const Write& write, const test::Tolerances& tolerances) {
  for (std::uint32_t seed = 0; seed < kModels; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const test::RandomModel model = random_model(seed);
    const Scene plain = load(write_plain(model).gltf());
    const Scene packed = load(write(model).gltf());
    EXPECT_TRUE(plain.warnings.empty()) << plain.warnings.front();
    EXPECT_TRUE(packed.warnings.empty()) << packed.warnings.front();
    expect_same_scene(plain, packed, tolerances);
    if (::testing::Test::HasFailure()) return;
  }
}

void expect_refused(const Json& document, const std::string& what, const std::string& where) {
  const test::Refusal found = refusal(document);
  EXPECT_EQ(found.code, ExitCode::BadInput) << what << ": " << found.message;
  EXPECT_NE(found.message.find(where), std::string::npos) << what << ": " << found.message;
  EXPECT_NE(found.message.find(what), std::string::npos) << where << ": " << found.message;
}

TEST(GltfMeshopt, AttributesAndIndicesWithoutFiltersKeepEveryBit) {
  expect_same_models([](const auto& model) { return write_meshopt(model, {.index_mode = "TRIANGLES"}); }, {});
  expect_same_models([](const auto& model) { return write_meshopt(model, {.index_mode = "INDICES"}); }, {});
}

TEST(GltfMeshopt, PointsAndLinesAreReadAsTrianglesAre) {
  const test::RandomModel model = random_model(3);
  for (const int mode : {0, 1}) {
    const auto drawn_as = [&](test::ModelWriter writer) {
      for (std::size_t p = 0; p < model.primitives.size(); ++p) writer.primitive(p)["mode"] = mode;
      return load(writer.gltf());
    };
    const Scene plain = drawn_as(write_plain(model));
    const Scene packed = drawn_as(write_meshopt(model, {.index_mode = "INDICES"}));
    ASSERT_EQ(packed.meshes.size(), plain.meshes.size());
    for (std::size_t i = 0; i < plain.meshes.size(); ++i) {
      EXPECT_EQ(packed.meshes[i].kind, mode == 0 ? MeshKind::Points : MeshKind::Lines);
      EXPECT_FALSE(packed.meshes[i].triangles.empty());
      EXPECT_EQ(packed.meshes[i].positions, plain.meshes[i].positions);
      EXPECT_EQ(packed.meshes[i].colors, plain.meshes[i].colors);
      EXPECT_EQ(packed.meshes[i].triangles, plain.meshes[i].triangles);
    }
  }
}

TEST(GltfMeshopt, FiltersKeepWhatTheyRoundTo) {
  // Octahedral vectors of n bits: two steps of 2 / 2^n and what normalising makes of them.
  expect_same_models([](const auto& model) { return write_meshopt(model, {.direction_bytes = 1}); }, {.normal = 0.03F});
  expect_same_models([](const auto& model) { return write_meshopt(model, {.direction_bytes = 2}); },
                     {.normal = 1.5e-4F});
  // Of mantissas of 20 bits for vectors below 32 half of 32 / 2^19.
  expect_same_models([](const auto& model) { return write_meshopt(model, {.mantissa_bits = 20}); },
                     {.position = 3.1e-5F, .normal = 2e-3F, .uv = 2e-6F, .color = 2e-6F});
}

TEST(GltfMeshopt, QuaternionsTurnInstances) {
  test::Random random(7);
  std::vector<float> turns;
  for (int i = 0; i < 50; ++i) {
    const glm::quat turn = glm::normalize(glm::quat(
        test::random_float(random, -1, 1), test::random_float(random, -1, 1), test::random_float(random, -1, 1), 0.1F));
    turns.insert(turns.end(), {turn.x, turn.y, turn.z, turn.w});
  }
  test::ModelWriter plain = write_plain(random_model(1));
  test::ModelWriter packed = plain;
  const auto turned_by = [](test::ModelWriter& writer, std::size_t accessor) {
    writer.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["ROTATION"] = accessor;
  };
  turned_by(plain, plain.add_plain(test::floats_of(turns, 4)));
  std::vector<std::byte> content(std::size_t{50} * 8);
  meshopt_encodeFilterQuat(content.data(), 50, 8, 16, turns.data());
  const std::size_t accessor = packed.add_accessor({5122, 4, true}, 50);
  packed.json["accessors"][accessor]["bufferView"] = add_meshopt_view(packed, content, 8, "ATTRIBUTES", "QUATERNION");
  turned_by(packed, accessor);

  const Scene a = load(plain.gltf());
  const Scene b = load(packed.gltf());
  ASSERT_EQ(a.instances.size(), b.instances.size());
  ASSERT_GE(a.instances.size(), 51U);
  for (std::size_t i = 0; i < a.instances.size(); ++i) {
    for (int c = 0; c < 4; ++c) {
      EXPECT_LT(glm::distance(a.instances[i].to_world[c], b.instances[i].to_world[c]), 2e-4) << i;
    }
  }
}

TEST(GltfMeshopt, KnownBytesOfFiltersBecomeKnownValues) {
  // As the extension's appendix B decodes them: x, y and one of 127; a mantissa of 3 and an exponent of -1.
  test::Document document = test::triangle();
  const std::vector<std::int8_t> octahedral{0, 0, 127, 5, 127, 0, 127, 5, 0, -127, 127, 5};
  const std::int32_t half = 3 | (-1 * (1 << 24));
  const std::vector<std::int32_t> exponential{half, 0, 0, 0, half, 0, 0, 0, half};
  test::ModelWriter writer;
  Json made{{"attributes", Json::object()}};
  const std::size_t normals = writer.add_accessor({5120, 3, true}, 3);
  writer.json["accessors"][normals]["bufferView"] =
      add_meshopt_view(writer, std::as_bytes(std::span(octahedral)), 4, "ATTRIBUTES", "OCTAHEDRAL");
  const std::size_t positions = writer.add_accessor({5126, 3, false}, 3);
  writer.json["accessors"][positions]["bufferView"] =
      add_meshopt_view(writer, std::as_bytes(std::span(exponential)), 12, "ATTRIBUTES", "EXPONENTIAL");
  made["attributes"] = {{"POSITION", positions}, {"NORMAL", normals}};
  writer.add_primitive(made);
  const Scene scene = load(writer.gltf());
  const Mesh& mesh = scene.meshes.at(0);
  EXPECT_EQ(mesh.normals[0], glm::vec3(0, 0, 1));
  EXPECT_EQ(mesh.normals[1], glm::vec3(1, 0, 0));
  EXPECT_EQ(mesh.normals[2], glm::vec3(0, -1, 0));
  EXPECT_EQ(mesh.positions[0], glm::vec3(1.5F, 0, 0));
  EXPECT_EQ(mesh.positions[1], glm::vec3(0, 1.5F, 0));
  EXPECT_EQ(mesh.positions[2], glm::vec3(0, 0, 1.5F));
}

TEST(GltfMeshopt, CompressedDataArePreferredToTheBufferThatStandsInForThem) {
  const test::RandomModel model = random_model(2);
  const Scene plain = load(write_plain(model).gltf());
  Json document = write_meshopt(model, {}).gltf();
  document.erase("extensionsRequired");
  expect_same_scene(plain, load(document), {});
  // Zeros that nobody reads.
  std::uint64_t bytes = 0;
  for (Json& view : document["bufferViews"].elements()) {
    if (view["buffer"].get<int>() == 1) bytes += view["byteLength"].get<std::uint64_t>();
  }
  document["buffers"][1]["byteLength"] = bytes;
  document["buffers"][1]["uri"] = "missing.bin";
  expect_same_scene(plain, load(document), {});
  // A view that reads them needs them.
  document["bufferViews"].push_back({{"buffer", 1}, {"byteLength", 4}});
  EXPECT_EQ(refusal(document).code, ExitCode::Io);
  document["buffers"][1].erase("uri");
  expect_refused(document, "neither a uri nor", "buffers[1]");
}

TEST(GltfMeshopt, DescriptionsThatDoNotFitAreRefused) {
  const Json good = write_meshopt(random_model(1), {.direction_bytes = 2}).gltf();
  ASSERT_EQ(refusal(good).code, ExitCode::Done) << refusal(good).message;
  const auto with = [&](const char* key, const Json& value) {
    Json bad = good;
    for (Json& view : bad["bufferViews"].elements()) {
      if (!view.contains("extensions")) continue;
      view["extensions"][kMeshopt][key] = value;
      if (key == std::string("byteStride")) view.erase(key);
    }
    return bad;
  };
  expect_refused(with("mode", "POINTS"), "POINTS", "mode");
  expect_refused(with("filter", "COLOR"), "COLOR", "filter");
  expect_refused(with("mode", 1), "text", "mode");
  expect_refused(with("count", 1), "are not the", kMeshopt);
  expect_refused(with("count", std::uint64_t{1} << 53), "are not the", kMeshopt);
  expect_refused(with("count", 0), "whole number", "count");
  expect_refused(with("byteStride", 257), "whole number", "byteStride");
  expect_refused(with("byteStride", 6), "multiple of 4", kMeshopt);
  expect_refused(with("buffer", 9), "only 2", "buffer");
  expect_refused(with("byteOffset", 1 << 30), "leave buffer 0", kMeshopt);
  expect_refused(with("byteLength", 1 << 30), "leave buffer 0", kMeshopt);
  expect_refused(with("byteLength", 8), "", kMeshopt);
  expect_refused(with("mode", "TRIANGLES"), "indices of", kMeshopt);
  expect_refused(with("filter", "QUATERNION"), "", kMeshopt);
}

TEST(GltfMeshopt, WhatIsDecodedCountsAgainstTheLimitBeforeItIsAllocated) {
  // Zeros shrink to a hundredth.
  test::ModelWriter writer;
  const std::vector<std::byte> zeros(1 << 20);
  const std::size_t view = add_meshopt_view(writer, zeros, 16, "ATTRIBUTES", nullptr);
  writer.json["accessors"].push_back({{"componentType", 5126}, {"count", 3}, {"type", "VEC3"}, {"bufferView", view}});
  writer.add_primitive({{"attributes", {{"POSITION", writer.json["accessors"].size() - 1}}}});
  Json document = writer.gltf();
  EXPECT_EQ(refusal(document).code, ExitCode::Done);
  SceneLimits limits;
  limits.memory_bytes = 900'000;
  EXPECT_EQ(refusal(document, limits).code, ExitCode::Limit);
  Json& extension = document["bufferViews"][view]["extensions"][kMeshopt];
  extension["count"] = std::uint64_t{1} << 40;
  document["bufferViews"][view]["byteLength"] = std::uint64_t{1} << 44;
  expect_refused(document, "cannot hold", kMeshopt);
}

/// Every tenth length of the compressed data, and bytes that are changed, end in an error or in a scene.
void expect_errors_only(const Json& good, const std::vector<std::size_t>& views) {
  const Json& buffer = good["buffers"][0];
  const std::string head = "data:application/octet-stream;base64,";
  test::Random random(3);
  int refused = 0;
  for (int i = 0; i < 300; ++i) {
    Json bad = good;
    std::string text = buffer["uri"].string();
    for (int k = 0; k < 1 + i % 4; ++k) {
      text[head.size() + random() % (text.size() - head.size() - 4)] = "AQgw/4z0"[random() % 8];
    }
    bad["buffers"][0]["uri"] = text;
    if (i % 3 == 0) {
      Json& view = bad["bufferViews"][views[random() % views.size()]];
      Json& length = view.contains("extensions") ? view["extensions"][kMeshopt]["byteLength"] : view["byteLength"];
      length = 1 + random() % length.get<std::uint64_t>();
    }
    const test::Refusal found = refusal(bad);
    EXPECT_TRUE(found.code == ExitCode::Done || found.code == ExitCode::BadInput) << found.message;
    if (found.code == ExitCode::BadInput) ++refused;
  }
  EXPECT_GT(refused, 50);
}

TEST(GltfMeshopt, BrokenDataAreRefused) {
  const Json good = write_meshopt(random_model(4), {}).gltf();
  std::vector<std::size_t> views;
  for (std::size_t i = 0; i < good["bufferViews"].size(); ++i) {
    if (good["bufferViews"][i].contains("extensions")) views.push_back(i);
  }
  expect_errors_only(good, views);
}

TEST(GltfDraco, LosslessMeshesKeepEveryBit) {
  for (const bool sequential : {false, true}) {
    for (const bool seams : {false, true}) {
      for (const int speed : {0, 5, 10}) {
        SCOPED_TRACE(::testing::Message() << "sequential " << sequential << " seams " << seams << " speed " << speed);
        expect_same_models(
            [&](const auto& model) {
              return write_draco(model, {.sequential = sequential, .lossless = true, .seams = seams, .speed = speed});
            },
            {});
      }
    }
  }
}

TEST(GltfDraco, QuantizedMeshesKeepWhatTheyRoundTo) {
  // A step of the largest side of the box, 25 of 2^14; of normals two of octahedral ones of 10 bits; of flat normals
  // the tilt that a step makes of a triangle.
  for (const bool sequential : {false, true}) {
    for (const int speed : {0, 3, 7, 10}) {
      SCOPED_TRACE(::testing::Message() << "sequential " << sequential << " speed " << speed);
      expect_same_models(
          [&](const auto& model) { return write_draco(model, {.sequential = sequential, .speed = speed}); },
          {.position = 1.6e-3F, .normal = 8e-3F, .uv = 2.5e-4F, .color = 1e-3F});
    }
  }
}

TEST(GltfDraco, MorphTargetsFollowTheOrderOfTheMesh) {
  // Sequential meshes without merged points keep their order.
  const test::RandomModel model = random_model(3);
  const auto morphed = [&](test::ModelWriter writer) {
    test::Random random(5);
    std::vector<float> moves(model.primitives[0].attributes.at("POSITION").count() * 3);
    for (float& move : moves) move = test::random_float(random, -0.1F, 0.1F);
    writer.primitive(0)["targets"].push_back({{"POSITION", writer.add_plain(test::floats_of(moves, 3))}});
    writer.json["meshes"][0]["weights"] = Json::array({0.5});
    return load(writer.gltf());
  };
  expect_same_scene(morphed(write_plain(model)),
                    morphed(write_draco(model, {.sequential = true, .lossless = true, .seams = false})), {});
}

TEST(GltfDraco, StripsAndPrimitivesWithoutIndicesAreTriangles) {
  const test::RandomModel model = random_model(3);
  const Scene plain = load(write_plain(model).gltf());
  Json strip = write_draco(model, {.lossless = true}).gltf();
  strip["meshes"][0]["primitives"][0]["mode"] = 5;
  expect_same_scene(plain, load(strip), {});
  Json bare = write_draco(model, {.lossless = true}).gltf();
  bare["meshes"][0]["primitives"][0].erase("indices");
  expect_same_scene(plain, load(bare), {});
  bare["meshes"][0]["primitives"][0]["mode"] = 1;
  expect_refused(bare, "triangle strips", "meshes[0].primitives[0]");
}

TEST(GltfDraco, CompressedDataArePreferredToAccessorsWithBytes) {
  const test::RandomModel model = random_model(5);
  test::ModelWriter writer = write_draco(model, {.lossless = true});
  const std::vector<std::byte> zeros(1 << 20);
  const std::size_t view = writer.add_view(zeros);
  for (Json& accessor : writer.json["accessors"].elements()) accessor["bufferView"] = view;
  Json document = writer.gltf();
  document.erase("extensionsRequired");
  expect_same_scene(load(write_plain(model).gltf()), load(document), {});
}

TEST(GltfDraco, MeshesThatAreNotWhatTheDocumentSaysAreRefused) {
  const Json good = write_draco(random_model(1), {}).gltf();
  ASSERT_EQ(refusal(good).code, ExitCode::Done) << refusal(good).message;
  const Json& primitive = good["meshes"][0]["primitives"][0];
  const auto with = [&](const Json& accessor, const char* key, const Json& value) {
    Json bad = good;
    bad["accessors"][accessor.get<std::size_t>()][key] = value;
    return bad;
  };
  const Json& position = primitive["attributes"]["POSITION"];
  const auto points = good["accessors"][position.get<std::size_t>()]["count"].get<int>();
  const auto indices = good["accessors"][primitive["indices"].get<std::size_t>()]["count"].get<int>();
  expect_refused(with(position, "count", points + 1), "points", "attributes.POSITION");
  expect_refused(with(position, "count", points - 1), "points", "attributes.POSITION");
  expect_refused(with(position, "count", 1), "points", "attributes.POSITION");
  expect_refused(with(primitive["indices"], "count", indices + 3), "triangles", "indices");
  expect_refused(with(primitive["indices"], "count", indices - 3), "triangles", "indices");
  expect_refused(with(position, "type", "VEC4"), "components", "attributes.POSITION");
  expect_refused(with(position, "type", "MAT3"), "components", "attributes.POSITION");

  Json bad = good;
  Json& extension = bad["meshes"][0]["primitives"][0]["extensions"][kDraco];
  extension["attributes"]["POSITION"] = 77;
  expect_refused(bad, "no attribute 77", "POSITION");
  extension["attributes"]["POSITION"] = -1;
  expect_refused(bad, "whole number", "POSITION");
  extension["attributes"] = 3;
  expect_refused(bad, "object", "attributes");
  extension.erase("attributes");
  expect_refused(bad, "missing", "attributes");
  extension["bufferView"] = 99;
  expect_refused(bad, "only", "bufferView");
}

TEST(GltfDraco, OtherBytesAreRefused) {
  Json document = write_draco(random_model(1), {}).gltf();
  const auto view = document["meshes"][0]["primitives"][0]["extensions"][kDraco]["bufferView"].get<std::size_t>();
  const std::string where = "bufferViews[" + std::to_string(view) + "]";
  document["bufferViews"][view]["byteOffset"] = document["bufferViews"][view]["byteOffset"].get<int>() + 1;
  expect_refused(document, "no triangle mesh of Draco", where);
  document["bufferViews"][view]["byteOffset"] = 1 << 30;
  expect_refused(document, "leave buffer 0", where);
}

TEST(GltfDraco, BrokenDataAreRefused) {
  for (const bool sequential : {false, true}) {
    const Json good = write_draco(random_model(4), {.sequential = sequential}).gltf();
    std::vector<std::size_t> views(good["bufferViews"].size());
    for (std::size_t i = 0; i < views.size(); ++i) views[i] = i;
    expect_errors_only(good, views);
  }
}

TEST(GltfDraco, WhatIsDecodedCountsAgainstTheLimitBeforeItIsAllocated) {
  // Attributes of zeros take next to nothing in the file, and the extension need not name them.
  test::RandomModel model;
  test::Random random(1);
  model.primitives.push_back(test::random_primitive(random, 5123));
  const std::size_t count = model.primitives[0].attributes["POSITION"].count();
  constexpr int kZeros = 100;
  for (int i = 0; i < kZeros; ++i) {
    model.primitives[0].attributes["_ZERO" + std::to_string(i)] =
        test::integers_of(std::vector<std::uint32_t>(count * 4), 4, 5121, false);
  }
  Json document = write_draco(model, {}).gltf();
  ASSERT_EQ(refusal(document).code, ExitCode::Done) << refusal(document).message;
  Json& primitive = document["meshes"][0]["primitives"][0];
  for (int i = 0; i < kZeros; ++i) {
    primitive["attributes"].erase("_ZERO" + std::to_string(i));
    primitive["extensions"][kDraco]["attributes"].erase("_ZERO" + std::to_string(i));
  }
  SceneLimits limits;
  limits.memory_bytes = 1'000'000;
  const test::Refusal found = refusal(document, limits);
  EXPECT_EQ(found.code, ExitCode::Limit) << found.message;
  EXPECT_NE(found.message.find("Draco"), std::string::npos) << found.message;
}

TEST(GltfDraco, TrianglesThatTheBytesOnlyClaimAreNotAllocated) {
  // The header of a sequential mesh of 2^30 triangles and 2^20 points.
  const std::vector<unsigned char> header{'D',  'R',  'A',  'C',  'O',  2,    2,    1,    0,    0, 0,
                                          0x80, 0x80, 0x80, 0x80, 0x04, 0x80, 0x80, 0x40, 0x00, 0, 0};
  test::ModelWriter writer;
  const std::size_t view = writer.add_view(std::as_bytes(std::span(header)));
  const std::size_t position = writer.add_accessor({5126, 3, false}, 1 << 20);
  const std::size_t indices = writer.add_accessor({5125, 1, false}, std::size_t{3} << 30);
  Json primitive{{"attributes", {{"POSITION", position}}}, {"indices", indices}};
  primitive["extensions"][kDraco] = {{"bufferView", view}, {"attributes", {{"POSITION", 0}}}};
  writer.add_primitive(primitive);
  const test::Refusal found = refusal(writer.gltf());
  EXPECT_EQ(found.code, ExitCode::Limit) << found.message;
}

}  // namespace
}  // namespace hpr
