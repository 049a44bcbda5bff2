// Frames have the same bits wherever their texels lie, and however they came there.
#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include "cluster/transport/local_communicator.h"
#include "core/progress.h"
#include "engine/settings/test_frames.h"
#include "scene/generators/generators.h"
#include "scene/gltf/gltf.h"
#include "scene/gltf/test_tools.h"
#include "scene/load_scene.h"
#include "scene/partial_mesh.h"
#include "scene/view.h"

namespace hpr {
namespace {

using namespace std::chrono_literals;
using test::Options;
using test::settings_with;

constexpr int kSide = 64;

/// The gallery, all of whose materials have textures of their own.
Scene textured_gallery() {
  Scene scene = generate_scene("gallery?s=1&n=2&k=2");
  std::mt19937 random(7);
  for (Material& material : scene.materials) {
    for (TextureRef* const reference : {&material.base_color_texture, &material.metallic_roughness_texture}) {
      Image<Rgba8> image({kSide, kSide});
      for (Rgba8& texel : image.pixels()) {
        const auto level = [&] { return static_cast<std::uint8_t>(100 + random() % 156); };
        texel = {level(), level(), level(), 255};
      }
      reference->texture = static_cast<std::int32_t>(scene.textures.size());
      scene.textures.emplace_back().image = std::move(image);
    }
  }
  return scene;
}

class TexturedParts : public testing::Test {
 protected:
  TexturedParts() {
    const std::vector<std::byte> file = encode_glb(textured_gallery());
    path_ = folder_.write("gallery.glb", {reinterpret_cast<const char*>(file.data()), file.size()});
  }

  /// Two frames, the second of another screen. `room`: what of the scene's textures a rank may hold, in 0 to 1.
  [[nodiscard]] std::vector<Rgb> draw(const LocalRanks& ranks, const Options& more, double room = 1.0) const {
    const RenderSettings settings = settings_with(test::joined({{"primary", "rays"}, {"photons", "300"}}, more));
    std::vector<Rgb> pixels;
    run_local_ranks(ranks, [&](Communicator& comm) {
      Session session(comm, {.threads = 2}, [&] {
        LoadedScene loaded = load_scene(path_.string(), settings, {}, {}, first_view(settings, {100, 70}));
        if (room < 1.0) {
          const double texels = static_cast<double>(loaded.scene.textures.size() * kSide * kSide * sizeof(Rgba8));
          loaded.memory_limit =
              memory_of(loaded.scene) + whole_memory_of(loaded.scene) + static_cast<std::uint64_t>(room * texels);
        }
        return loaded;
      });
      for (std::uint64_t number = 0; number < 2; ++number) {
        const Camera camera = choose_camera({}, session.scene());
        const std::vector<View> screens{
            make_view(camera, number == 0 ? Size{100, 70} : Size{60, 90}, session.scene().bounds)};
        FrameMaker maker(session, settings.frame, settings.sampling, screens, std::nullopt);
        Progress progress("none", "sample", 0);
        Frame* const frame = maker.make(screens, number, progress);
        ASSERT_NE(frame, nullptr);
        test::add_pixels(session, maker, *frame, frame->radiance, pixels);
      }
    });
    return pixels;
  }

  test::TemporaryFolder folder_;
  std::filesystem::path path_;
};

TEST_F(TexturedParts, FramesHaveTheBitsOfOneRank) {
  const std::vector<Rgb> expected = draw({.size = 1}, {});
  ASSERT_FALSE(expected.empty());
  const Options parts{{"data", "partitioned"}};
  EXPECT_TRUE(draw({.size = 1}, parts) == expected) << "read when looked at";
  for (const int ranks : {2, 3, 4, 7}) {
    for (const int per_host : {0, 2}) {
      const LocalRanks local{.size = ranks, .hang_timeout = 60s, .ranks_per_host = per_host, .disorder = 5};
      EXPECT_TRUE(draw(local, {}) == expected) << ranks << " whole, " << per_host << " a host";
      EXPECT_TRUE(draw(local, parts) == expected) << ranks << " in parts, " << per_host << " a host";
    }
  }
  const Options islands{{"data", "partitioned"}, {"distribute", "hybrid"}};
  EXPECT_TRUE(draw({.size = 4, .hang_timeout = 60s, .ranks_per_host = 2}, islands) == expected);
}

TEST_F(TexturedParts, TexelsThatGoAndComeAgainAreTheSame) {
  const std::vector<Rgb> expected = draw({.size = 1}, {});
  const Options parts{{"data", "partitioned"}};
  EXPECT_TRUE(draw({.size = 1}, parts, 0.1) == expected);
  EXPECT_TRUE(draw({.size = 3, .hang_timeout = 60s}, parts, 0.05) == expected);
  EXPECT_TRUE(draw({.size = 4, .hang_timeout = 60s, .ranks_per_host = 2}, parts, 0.05) == expected);
}

}  // namespace
}  // namespace hpr
