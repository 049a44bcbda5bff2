#include "scene/scene_files.h"

#include <gtest/gtest.h>

#include "scene/gltf/test_tools.h"

namespace hpr {
namespace {

using Files = std::vector<std::filesystem::path>;

TEST(SceneFiles, OfADocumentAreItsOwnItsBuffersAndItsPictures) {
  const test::TemporaryFolder folder;
  const auto scene = folder.write("a.gltf", R"({"asset": {"version": "2.0"},
      "buffers": [{"uri": "sub/b%20c.bin"}, {"uri": "data:;base64,Zg=="}, {"byteLength": 1}],
      "images": [{"uri": "d.png"}, {"uri": "../out.png"}, {"uri": 7}, 8, {"bufferView": 0}]})");
  EXPECT_EQ(files_of_scene(scene.string()), (Files{scene, folder.path() / "sub/b c.bin", folder.path() / "d.png"}));
}

TEST(SceneFiles, WhatCannotBeReadIsJustItself) {
  const test::TemporaryFolder folder;
  const auto broken = folder.write("b.gltf", "{\"buffers\": [");
  EXPECT_EQ(files_of_scene(broken.string()), Files{broken});
  const auto list = folder.write("c.gltf", "[1]");
  EXPECT_EQ(files_of_scene(list.string()), Files{list});
  EXPECT_EQ(files_of_scene("none.glb"), Files{"none.glb"});
}

TEST(SceneFiles, WhatIsBeyondTheLimitsIsJustItself) {
  const test::TemporaryFolder folder;
  const auto scene = folder.write("a.gltf", R"({"images": [{"uri": "d.png"}]})");
  EXPECT_EQ(files_of_scene(scene.string()).size(), 2U);
  SceneLimits small;
  small.file_bytes = 20;
  EXPECT_EQ(files_of_scene(scene.string(), small), Files{scene});
  small = {};
  small.memory_bytes = 100;
  EXPECT_EQ(files_of_scene(scene.string(), small), Files{scene});
}

TEST(SceneFiles, OfAGeneratedSceneThereAreNone) {
  EXPECT_TRUE(files_of_scene("gen:cornell").empty());
}

}  // namespace
}  // namespace hpr
