// A large mesh that is read in pieces is the one that is read whole, and what is wrong with it is said as before.
#include "scene/gltf/pieces/primitive_reader.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <fstream>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "scene/gltf/gltf.h"
#include "scene/gltf/test_tools.h"
#include "scene/partial_mesh.h"

namespace hpr {
namespace {

using test::Document;
using test::TemporaryFolder;

/// The numbers of a mesh as a file has them.
struct Arrays {
  std::vector<float> positions;
  std::vector<float> normals;
  std::vector<float> uvs;
  std::vector<float> colors;  ///< three of a vertex
  std::vector<float> tangents;
  std::vector<std::uint32_t> indices;
};

/// A bumpy grid with so many vertices along a side, its triangles shuffled over all of it.
Arrays bumpy_grid(std::uint32_t side) {
  Arrays grid;
  std::mt19937 random(7);
  for (std::uint32_t i = 0; i < side * side; ++i) {
    const auto x = static_cast<float>(i % side);
    const auto y = static_cast<float>(i / side);
    grid.positions.insert(grid.positions.end(), {x, y, 3.0F * std::sin(0.1F * x) * std::cos(0.07F * y)});
    const float tilt = 0.01F * static_cast<float>(random() % 50);
    const float length = std::sqrt(1.0F + tilt * tilt);
    grid.normals.insert(grid.normals.end(), {tilt / length, 0.0F, 1.0F / length});
    grid.uvs.insert(grid.uvs.end(), {x / 16.0F, y / 16.0F});
    grid.colors.insert(grid.colors.end(), {x / static_cast<float>(side), 0.5F, 0.25F});
    grid.tangents.insert(grid.tangents.end(), {1.0F, 0.0F, 0.0F, i % 2 == 0 ? 1.0F : -1.0F});
  }
  std::vector<glm::uvec3> triangles;
  for (std::uint32_t y = 0; y + 1 < side; ++y) {
    for (std::uint32_t x = 0; x + 1 < side; ++x) {
      const std::uint32_t at = y * side + x;
      triangles.emplace_back(at, at + 1, at + side);
      if ((x + y) % 3 != 0) triangles.emplace_back(at + 1, at + side + 1, at + side);
    }
  }
  for (std::size_t i = triangles.size(); i > 1; --i) std::swap(triangles[i - 1], triangles[random() % i]);
  for (const glm::uvec3& t : triangles) grid.indices.insert(grid.indices.end(), {t.x, t.y, t.z});
  return grid;
}

/// A document with what of `arrays` is not empty.
Document document_of(const Arrays& arrays) {
  Document document;
  Json& attributes = document.primitive()["attributes"];
  attributes["POSITION"] = document.add_vec3(arrays.positions);
  if (!arrays.normals.empty()) attributes["NORMAL"] = document.add_vec3(arrays.normals);
  if (!arrays.uvs.empty()) attributes["TEXCOORD_0"] = document.add_vec2(arrays.uvs);
  if (!arrays.colors.empty()) attributes["COLOR_0"] = document.add_vec3(arrays.colors);
  if (!arrays.tangents.empty()) {
    attributes["TANGENT"] = document.add(arrays.tangents, "VEC4", 5126, arrays.tangents.size() / 4);
  }
  if (!arrays.indices.empty()) {
    document.primitive()["indices"] = document.add(arrays.indices, "SCALAR", 5125, arrays.indices.size());
  }
  return document;
}

/// What a file is read as, or the error that it is.
struct Reading {
  std::optional<LoadedScene> loaded;
  std::string error;
};
Reading read(const std::filesystem::path& path, bool in_parts) {
  try {
    return {load_gltf(path, {}, {}, in_parts), {}};
  } catch (const Error& error) {
    return {std::nullopt, error.what()};
  }
}

/// Some triangles of a mesh with the vertices they use, in their order; with triangle 0 those that nobody uses.
Mesh plain_part_of(const Mesh& whole, const std::vector<SurfaceRange>& ranges) {
  std::vector<bool> used(whole.positions.size());
  for (const glm::uvec3& t : whole.triangles) used[t.x] = used[t.y] = used[t.z] = true;
  std::vector<bool> wanted(whole.positions.size());
  if (ranges.front().first == 0) {
    wanted = used;
    wanted.flip();
  }
  for (const SurfaceRange& range : ranges) {
    for (std::uint32_t t = range.first; t < range.last; ++t) {
      for (int corner = 0; corner < 3; ++corner) wanted[whole.triangles[t][corner]] = true;
    }
  }
  Mesh part;
  part.name = whole.name;
  part.material = whole.material;
  std::vector<std::uint32_t> numbers(whole.positions.size());
  for (std::size_t vertex = 0; vertex < wanted.size(); ++vertex) {
    if (!wanted[vertex]) continue;
    numbers[vertex] = static_cast<std::uint32_t>(part.positions.size());
    part.positions.push_back(whole.positions[vertex]);
    part.normals.push_back(whole.normals[vertex]);
    if (!whole.uvs[0].empty()) part.uvs[0].push_back(whole.uvs[0][vertex]);
    if (!whole.colors.empty()) part.colors.push_back(whole.colors[vertex]);
    if (!whole.tangents.empty()) part.tangents.push_back(whole.tangents[vertex]);
  }
  for (const SurfaceRange& range : ranges) {
    for (std::uint32_t t = range.first; t < range.last; ++t) {
      const glm::uvec3& corners = whole.triangles[t];
      part.triangles.emplace_back(numbers[corners.x], numbers[corners.y], numbers[corners.z]);
    }
  }
  return part;
}

enum class ReadAs { Pieces, Whole };

/// Reads a document both ways and compares all there is.
void expect_same(const Document& document, ReadAs expected, const std::string& what) {
  SCOPED_TRACE(what);
  const TemporaryFolder folder;
  const auto path = folder.write("scene.gltf", document.json.dump());
  const Reading whole = read(path, false);
  const Reading parts = read(path, true);
  ASSERT_EQ(parts.error, whole.error);
  ASSERT_EQ(parts.loaded.has_value(), whole.loaded.has_value());
  if (!whole.loaded) return;
  const Scene& scene = whole.loaded->scene;
  EXPECT_EQ(content_hash(parts.loaded->scene), content_hash(scene));
  EXPECT_EQ(parts.loaded->scene.warnings, scene.warnings);
  EXPECT_EQ(parts.loaded->scene.not_finite, scene.not_finite);
  EXPECT_EQ(to_bytes(parts.loaded->scene).size(), to_bytes([&] {
                                                    Scene stripped = scene;
                                                    for (Mesh& mesh : stripped.meshes) mesh = without_triangles(mesh);
                                                    return stripped;
                                                  }())
                                                      .size());
  const PartialMesh known = *without_triangles(scene.meshes[0]).partial;
  const PartialMesh& found = *parts.loaded->scene.meshes[0].partial;
  EXPECT_EQ(found.triangles, known.triangles);
  EXPECT_EQ(found.bounds.low, known.bounds.low);
  EXPECT_EQ(found.bounds.high, known.bounds.high);
  EXPECT_EQ(found.reach, known.reach);
  EXPECT_EQ(found.longest_edge, known.longest_edge);
  EXPECT_EQ(found.bytes, known.bytes);
  ASSERT_EQ(found.chunks.size(), known.chunks.size());
  for (std::size_t i = 0; i < known.chunks.size(); ++i) {
    ASSERT_EQ(found.chunks[i].low, known.chunks[i].low) << i;
    ASSERT_EQ(found.chunks[i].high, known.chunks[i].high) << i;
  }
  const std::unique_ptr<MeshReader> reader = parts.loaded->read_mesh(0);
  EXPECT_EQ(dynamic_cast<const WholeMeshReader*>(reader.get()) == nullptr, expected == ReadAs::Pieces);
  reader->name = scene.meshes[0].name;
  reader->material = scene.meshes[0].material;
  const std::vector<std::vector<SurfaceRange>> parts_of_it{
      {{0, 512}}, {{512, 1024}, {1536, 70000}, {70656, known.triangles}}, {{known.triangles - 1, known.triangles}}};
  for (const std::vector<SurfaceRange>& ranges : parts_of_it) {
    if (ranges.back().first >= ranges.back().last) continue;
    PartPieces pieces(*reader, ranges, known);
    Mesh part;
    while (std::optional<Mesh> piece = pieces.next()) {
      append_piece(part, *std::move(piece), pieces.vertices(), pieces.triangles());
    }
    ASSERT_EQ(part.triangles.size(), pieces.triangles());
    for (std::uint32_t t = ranges.front().first; t < ranges.front().last; ++t) ASSERT_TRUE(part.holds(t));
    part.partial = nullptr;
    EXPECT_EQ(content_hash(part), content_hash(plain_part_of(scene.meshes[0], ranges)));
  }
  EXPECT_EQ(content_hash(reader->take()), content_hash(scene.meshes[0]));
}

TEST(PrimitiveReader, ReadsWhatTheWholeMeshHas) {
  Arrays grid = bumpy_grid(300);
  expect_same(document_of(grid), ReadAs::Pieces, "all arrays");
  for (std::size_t i = 0; i < grid.normals.size(); i += 7) grid.normals[i] += 0.01F;
  expect_same(document_of(grid), ReadAs::Pieces, "normals nearly of unit length");
  grid.normals.clear();
  expect_same(document_of(grid), ReadAs::Pieces, "flat");
  grid.indices.clear();
  expect_same(document_of(grid), ReadAs::Pieces, "flat, without indices");
  grid = bumpy_grid(340);
  grid.positions.insert(grid.positions.end(), {900.0F, 0.0F, 0.0F});  // no triangle uses it
  grid.normals.insert(grid.normals.end(), {0.0F, 0.0F, 1.0F});
  grid.colors = grid.uvs = grid.tangents = {};
  expect_same(document_of(grid), ReadAs::Pieces, "an unused vertex");
  expect_same(document_of(bumpy_grid(60)), ReadAs::Whole, "a small mesh");
}

TEST(PrimitiveReader, ReadsIndicesAndPositionsOfEveryType) {
  const Arrays grid = bumpy_grid(250);
  Document document = document_of(grid);
  document.primitive()["indices"] = document.add_indices({grid.indices.begin(), grid.indices.end()});
  expect_same(document, ReadAs::Pieces, "16 bits");

  Arrays few = bumpy_grid(16);
  few.indices.clear();
  document = document_of(few);
  std::vector<std::uint8_t> bytes(3 * 400'000);
  std::mt19937 random(3);
  for (std::uint8_t& index : bytes) index = static_cast<std::uint8_t>(random());
  document.primitive()["indices"] = document.add(bytes, "SCALAR", 5121, bytes.size());
  expect_same(document, ReadAs::Pieces, "8 bits");

  document = document_of(grid);
  document.json["extensionsUsed"] = Json::array({"KHR_mesh_quantization"});
  std::vector<std::int16_t> packed;
  std::vector<std::int8_t> normals;
  for (std::size_t i = 0; i < grid.positions.size(); i += 3) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      packed.push_back(static_cast<std::int16_t>(100.0F * grid.positions[i + axis]));
      normals.push_back(axis == 2 ? 126 : 3);
    }
    packed.push_back(0);  // four bytes are an alignment of their own
    normals.push_back(0);
  }
  const int positions = document.add(packed, "VEC3", 5122, packed.size() / 4);
  document.json["bufferViews"][document.json["bufferViews"].size() - 1]["byteStride"] = 8;
  document.json["accessors"][document.json["accessors"].size() - 1]["normalized"] = true;
  const int packed_normals = document.add(normals, "VEC3", 5120, normals.size() / 4);
  document.json["bufferViews"][document.json["bufferViews"].size() - 1]["byteStride"] = 4;
  document.json["accessors"][document.json["accessors"].size() - 1]["normalized"] = true;
  document.primitive()["attributes"]["POSITION"] = positions;
  document.primitive()["attributes"]["NORMAL"] = packed_normals;
  expect_same(document, ReadAs::Pieces, "quantized");
}

TEST(PrimitiveReader, WhatIsOddIsReadWholeAndSaidAsBefore) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  const Arrays grid = bumpy_grid(212);
  const auto with = [&](const std::string& what, const std::function<void(Arrays&)>& change) {
    Arrays changed = grid;
    change(changed);
    expect_same(document_of(changed), ReadAs::Whole, what);
  };
  with("an index past the vertices", [](Arrays& a) { a.indices[a.indices.size() - 2] = 44944; });
  with("a position that is no number", [](Arrays& a) { a.positions[3000] = kNan; });
  with("a normal that is no number", [](Arrays& a) { a.normals[3000] = kNan; });
  with("a normal without direction", [](Arrays& a) { a.normals[30] = a.normals[31] = a.normals[32] = 0.0F; });
  with("a long normal", [](Arrays& a) { a.normals[32] = 2.0F; });
  with("a uv far out", [](Arrays& a) { a.uvs[77] = 3e6F; });
  with("a color beyond 1", [](Arrays& a) { a.colors[9] = 1.5F; });
  with("a tangent without sign", [](Arrays& a) { a.tangents[7] = 0.0F; });
  with("no whole number of triangles", [](Arrays& a) { a.indices.pop_back(); });

  Document document = document_of(grid);
  document.json["accessors"][0]["min"] = Json::array({0, 0, 0});
  document.json["accessors"][0]["max"] = Json::array({10, 10, 10});
  expect_same(document, ReadAs::Whole, "a box that is too small");

  document = document_of(grid);
  document.primitive()["mode"] = 5;
  expect_same(document, ReadAs::Whole, "a strip");

  document = document_of(grid);
  const std::vector<float> moved{5.0F, 6.0F, 7.0F};
  const int which = document.add_indices({41, 0});  // of accessors, which have a view each
  const int value = document.add_vec3(moved);
  document.json["accessors"][0]["sparse"] = {
      {"count", 1}, {"indices", {{"bufferView", which}, {"componentType", 5123}}}, {"values", {{"bufferView", value}}}};
  expect_same(document, ReadAs::Whole, "sparse positions");

  document = document_of(grid);
  const int target = document.add_vec3(grid.normals);
  document.primitive()["targets"].push_back({{"POSITION", target}});
  document.json["meshes"][0]["weights"] = Json::array({0.5});
  expect_same(document, ReadAs::Whole, "a morph target");

  document = document_of(grid);
  document.json["bufferViews"][5]["byteLength"] = 1000;
  expect_same(document, ReadAs::Whole, "indices that leave their buffer view");
}

TEST(PrimitiveReader, WhatAllRanksHoldIsThereWhole) {
  Document document = document_of(bumpy_grid(260));
  document.json["materials"].push_back({{"emissiveFactor", Json::array({1, 1, 1})}});
  document.primitive()["material"] = 0;
  const TemporaryFolder folder;
  const auto path = folder.write("scene.gltf", document.json.dump());
  const LoadedScene parts = load_gltf(path, {}, {}, true);
  EXPECT_EQ(to_bytes(parts.scene), to_bytes(load_gltf(path, {}).scene));
  EXPECT_FALSE(is_shared_out(parts.scene));
}

/// KiB of files that are in this process's memory.
long resident_file_kib() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("RssFile:")) return std::stol(line.substr(8));
  }
  return 0;
}

TEST(PrimitiveReader, LittleOfTheFileIsInMemoryAtATime) {
  Scene scene;
  Mesh& mesh = scene.meshes.emplace_back();
  const Arrays grid = bumpy_grid(1100);  // triangles all over it
  for (std::size_t i = 0; i < grid.positions.size(); i += 3) {
    mesh.positions.emplace_back(grid.positions[i], grid.positions[i + 1], grid.positions[i + 2]);
    mesh.normals.emplace_back(0.0F, 0.0F, 1.0F);
  }
  for (std::size_t i = 0; i < grid.indices.size(); i += 3) {
    mesh.triangles.emplace_back(grid.indices[i], grid.indices[i + 1], grid.indices[i + 2]);
  }
  scene.instances.resize(1);
  finish_scene(scene);
  const std::uint64_t whole = memory_of(mesh);
  ASSERT_GT(whole, std::uint64_t{48} << 20U);
  const std::vector<std::byte> file = encode_glb(scene);
  const TemporaryFolder folder;
  const auto path = folder.write("scene.glb", {reinterpret_cast<const char*>(file.data()), file.size()});

  const LoadedScene loaded = load_gltf(path, {}, {}, true);
  const long before = resident_file_kib();
  const std::unique_ptr<MeshReader> reader = loaded.read_mesh(0);
  EXPECT_LT(resident_file_kib() - before, 20 << 10);
  std::vector<std::uint32_t> corners;
  std::vector<glm::uvec3> triangles;
  std::vector<glm::vec3> positions;
  std::vector<float> normals;
  long peak = before;
  for (std::uint32_t first = 0; first + 65536 <= reader->vertices(); first += 65536) {
    reader->read(VertexArray::Normals, first, first + 65536, normals);
    peak = std::max(peak, resident_file_kib());
  }
  for (std::uint32_t first = 0; first + 65536 <= reader->triangles(); first += 65536) {
    reader->read_triangles(first, first + 65536, triangles);
    corners.clear();
    for (const glm::uvec3& t : triangles) corners.insert(corners.end(), {t.x, t.y, t.z});
    reader->read_positions(corners, positions);
    peak = std::max(peak, resident_file_kib());
  }
  EXPECT_LT(peak - before, 20 << 10);
}

}  // namespace
}  // namespace hpr
