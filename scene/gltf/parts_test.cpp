// A file that is read in parts has the meshes that it has when it is read whole.
#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "scene/generators/generators.h"
#include "scene/gltf/gltf.h"
#include "scene/gltf/test_tools.h"
#include "scene/partial_mesh.h"

namespace hpr {
namespace {

using test::TemporaryFolder;

/// Loads a file both ways, and compares.
void expect_same(const std::filesystem::path& path, std::size_t min_left_out) {
  const Scene whole = load_gltf(path, {}).scene;
  LoadedScene loaded = load_gltf(path, {}, {}, true);
  EXPECT_TRUE(loaded.in_parts);
  EXPECT_EQ(content_hash(loaded.scene), content_hash(whole));
  EXPECT_EQ(loaded.scene.warnings, whole.warnings);
  EXPECT_EQ(loaded.scene.not_finite, whole.not_finite);
  ASSERT_EQ(loaded.scene.meshes.size(), whole.meshes.size());
  std::size_t left_out = 0;
  for (std::uint32_t i = 0; i < whole.meshes.size(); ++i) {
    const Mesh& known = loaded.scene.meshes[i];
    EXPECT_EQ(known.partial == nullptr, is_held_by_all(whole, whole.meshes[i])) << i;
    if (!known.partial) continue;
    ++left_out;
    EXPECT_TRUE(known.triangles.empty());
    const std::unique_ptr<MeshReader> again = loaded.read_mesh(i);
    again->name = known.name;
    again->material = known.material;
    EXPECT_EQ(content_hash(*again), content_hash(whole.meshes[i])) << i;
    EXPECT_EQ(content_hash(again->take()), content_hash(whole.meshes[i])) << i;
  }
  EXPECT_GE(left_out, min_left_out);
}

TEST(GltfInParts, MeshesAreReadAgainAsTheyWere) {
  const TemporaryFolder folder;
  for (const char* name : {"gallery?s=1&n=2&k=1", "asteroids?count=5&k=2", "cornell", "extensions", "cloud?count=50"}) {
    const std::vector<std::byte> file = encode_glb(generate_scene(name));
    const auto path = folder.write("scene.glb", {reinterpret_cast<const char*>(file.data()), file.size()});
    expect_same(path, name == std::string("gallery?s=1&n=2&k=1") ? 10 : 1);
  }
}

TEST(GltfInParts, AMeshTakesMemoryOnlyWhileItIsRead) {
  const TemporaryFolder folder;
  const Scene scene = generate_scene("asteroids?count=40&k=4");  // 16 rocks
  const std::vector<std::byte> file = encode_glb(scene);
  const auto path = folder.write("scene.glb", {reinterpret_cast<const char*>(file.data()), file.size()});
  SceneLimits limits;
  limits.memory_bytes = memory_of(scene) / 2;
  EXPECT_THROW((void)load_gltf(path, limits), Error);
  LoadedScene loaded = load_gltf(path, limits, {}, true);
  EXPECT_EQ(content_hash(loaded.scene), content_hash(load_gltf(path, {}).scene));
  EXPECT_EQ(loaded.memory_limit, limits.memory_bytes);
  for (int again = 0; again < 3; ++again) {
    for (std::uint32_t i = 0; i < loaded.scene.meshes.size(); ++i) (void)loaded.read_mesh(i);
  }
  limits.memory_bytes = memory_of(scene.meshes.front()) / 2;
  EXPECT_THROW((void)load_gltf(path, limits, {}, true), Error);
}

TEST(GltfInParts, BuffersOfTheirOwnStayWhereTheyAre) {
  const TemporaryFolder folder;
  const std::vector<float> corners{0, 0, 0, 1, 0, 0, 0, 1, 0};
  folder.write("corners.bin", {reinterpret_cast<const char*>(corners.data()), corners.size() * sizeof(float)});
  const auto path = folder.write("scene.gltf", R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
      "nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
      "buffers":[{"uri":"corners.bin","byteLength":36}],"bufferViews":[{"buffer":0,"byteLength":36}],
      "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}]})");
  expect_same(path, 1);
}

}  // namespace
}  // namespace hpr
