#include "scene/load_scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "core/error.h"
#include "scene/gltf/test_tools.h"

namespace hpr {
namespace {

test::Refusal refused(const std::string& text, const ImageLimits& limits = {}) {
  try {
    (void)load_environment(text, limits);
  } catch (const Error& error) {
    return {error.code(), error.what(), error.hint()};
  }
  return {};
}

std::string text_of(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

TEST(Environment, ThreeNumbersAreTheSameRadianceEverywhere) {
  const Environment environment = load_environment("1,0.5,2e3");
  ASSERT_EQ(environment.image.size(), (Size{1, 1}));
  EXPECT_EQ(environment.image.at(0, 0), (Rgb{1.0F, 0.5F, 2000.0F}));
  EXPECT_EQ(environment.scale, 1.0);
}

TEST(Environment, WhatIsNeitherNumbersNorAPictureIsAUsageErrorWithAHint) {
  for (const char* text : {"", "1,1", "1,1,1,1", "1,1,1,", "1;1;1", "-1,0,0", "nan,0,0", "inf,0,0", "1e13,0,0", "sky",
                           "sky.tiff", "1,1,x"}) {
    const test::Refusal refusal = refused(text);
    EXPECT_EQ(refusal.code, ExitCode::Usage) << text;
    EXPECT_FALSE(refusal.hint.empty()) << text;
    EXPECT_NE(refusal.message.find(text), std::string::npos) << refusal.message;
  }
}

TEST(Environment, ExrKeepsItsRadianceAndLosesWhatIsNone) {
  const test::TemporaryFolder folder;
  Image<Rgb> image({3, 2}, {0.25F, 1e6F, 1e-6F});
  image.at(2, 1) = {std::numeric_limits<float>::quiet_NaN(), -1.0F, std::numeric_limits<float>::infinity()};
  const Environment environment = load_environment(folder.write("sky.EXR", text_of(encode_exr(image, {}))));
  EXPECT_EQ(environment.image.size(), image.size());
  EXPECT_EQ(environment.image.at(0, 1), (Rgb{0.25F, 1e6F, 1e-6F}));
  EXPECT_EQ(environment.image.at(2, 1), (Rgb{0.0F, 0.0F, 65504.0F}));
  EXPECT_EQ(environment.not_finite, 2U);
  EXPECT_EQ(environment.first_not_finite, 5U);
}

TEST(Environment, PicturesAreWhatTheirFirstBytesSay) {
  const test::TemporaryFolder folder;
  const Image<Rgb> image({3, 2}, {0.25F, 1e6F, 1e-6F});
  const Environment environment = load_environment(folder.write("sky.png", text_of(encode_exr(image, {}))));
  EXPECT_EQ(environment.image.at(0, 1), (Rgb{0.25F, 1e6F, 1e-6F}));
}

TEST(Environment, RadianceFilesHaveSharedExponents) {
  const test::TemporaryFolder folder;
  std::string file = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 1\n";
  // Mantissa / 256 times 2^(exponent - 128), give or take half a step of the mantissa.
  for (const int byte : {128, 64, 0, 129, 255, 128, 1, 138}) file += static_cast<char>(byte);
  const Environment environment = load_environment(folder.write("sky.hdr", file));
  ASSERT_EQ(environment.image.size(), (Size{1, 2}));
  EXPECT_NEAR(environment.image.at(0, 0).r, 1.0F, 1.0F / 128);
  EXPECT_NEAR(environment.image.at(0, 0).g, 0.5F, 1.0F / 128);
  EXPECT_NEAR(environment.image.at(0, 0).b, 0.0F, 1.0F / 128);
  EXPECT_NEAR(environment.image.at(0, 1).r, 1020.0F, 4.0F);
}

TEST(Environment, PngIsDecodedFromSrgb) {
  const test::TemporaryFolder folder;
  Image<Rgba8> image({2, 1}, {255, 188, 0, 255});
  const Environment environment = load_environment(folder.write("sky.png", text_of(encode_png(image))));
  EXPECT_EQ(environment.image.at(1, 0).r, 1.0F);
  EXPECT_EQ(environment.image.at(1, 0).g, srgb_to_linear(188));
  EXPECT_EQ(environment.image.at(1, 0).b, 0.0F);
}

TEST(Environment, PicturesThatCannotBeReadAreRefused) {
  const test::TemporaryFolder folder;
  EXPECT_EQ(refused((folder.path() / "none.exr").string()).code, ExitCode::Io);
  EXPECT_EQ(refused(folder.write("bad.hdr", "no picture").string()).code, ExitCode::BadInput);
  EXPECT_EQ(refused(folder.write("cut.hdr", "#?RADIANCE\n").string()).code, ExitCode::BadInput);
  const auto large = folder.write("large.exr", text_of(encode_exr(Image<Rgb>({9, 1}), {})));
  EXPECT_EQ(refused(large.string(), {.side = 8}).code, ExitCode::Limit);
}

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
