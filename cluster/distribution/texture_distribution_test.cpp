// Texels are the same however they came, once for each host.
#include "cluster/distribution/texture_distribution.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <functional>
#include <mutex>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "cluster/distribution/scene_distribution.h"
#include "cluster/transport/collectives.h"
#include "cluster/transport/communicator_wrappers.h"
#include "cluster/transport/local_communicator.h"
#include "cluster/transport/test_communicator.h"
#include "core/error.h"
#include "scene/gltf/gltf.h"
#include "scene/gltf/test_tools.h"

namespace hpr {
namespace {

using test::expect_error_on_all;
using test::TemporaryFolder;

constexpr int kSide = 64;
constexpr std::size_t kPictureBytes = kSide * kSide * sizeof(Rgba8);
constexpr std::size_t kPictures = 8;  // the last one gives light

Image<Rgba8> noise(unsigned int seed) {
  std::mt19937 random(seed);
  Image<Rgba8> image({kSide, kSide});
  for (Rgba8& texel : image.pixels()) {
    texel = {static_cast<std::uint8_t>(random() % 200), static_cast<std::uint8_t>(random() % 200), 77, 255};
  }
  return image;
}

/// A triangle for each picture, and one more texture of the first picture.
Scene textured_scene() {
  Scene scene;
  for (unsigned int i = 0; i < kPictures; ++i) {
    Mesh mesh;
    const auto x = static_cast<float>(i);
    mesh.positions = {{x, 0, 0}, {x + 1, 0, 0}, {x, 1, 0}};
    mesh.normals.assign(3, {0, 0, 1});
    mesh.uvs[0] = {{0, 0}, {1, 0}, {0, 1}};
    mesh.triangles = {{0, 1, 2}};
    mesh.material = i;
    scene.meshes.push_back(mesh);
    scene.instances.emplace_back().mesh = i;
    scene.textures.emplace_back().image = noise(i);
    Material material;
    const bool is_lamp = i + 1 == kPictures;
    (is_lamp ? material.emissive_texture : material.base_color_texture).texture = static_cast<std::int32_t>(i);
    if (is_lamp) material.emissive = glm::vec3(1.0F);
    scene.materials.push_back(material);
  }
  finish_scene(scene);
  return scene;
}

class TextureDistribution : public testing::Test {
 protected:
  TextureDistribution() {
    const std::vector<std::byte> file = encode_glb(scene_);
    path_ = folder_.write("scene.glb", {reinterpret_cast<const char*>(file.data()), file.size()});
    whole_ = load_gltf(path_, {}).scene;
  }

  [[nodiscard]] LoadedScene load(bool in_parts) const { return load_gltf(path_, {}, {}, in_parts); }

  void expect_texels(const Scene& scene) const {
    ASSERT_EQ(scene.textures.size(), scene_.textures.size());
    for (std::size_t i = 0; i < scene.textures.size(); ++i) {
      EXPECT_TRUE(std::ranges::equal(scene.textures[i].image.pixels(), scene_.textures[i].image.pixels())) << i;
    }
  }

  Scene scene_ = textured_scene();
  Scene whole_;  ///< as it is read from a file
  TemporaryFolder folder_;
  std::filesystem::path path_;
};

/// Where ranks find the texels of picture 3.
class Addresses {
 public:
  void add(const Scene& scene) {
    const std::lock_guard lock(mutex_);
    found_.insert(scene.textures[3].image.pixels().data());
  }
  [[nodiscard]] std::size_t count() const { return found_.size(); }

 private:
  std::mutex mutex_;
  std::set<const Rgba8*> found_;
};

TEST_F(TextureDistribution, TexelsAreTheSameAndOnceForEachHost) {
  for (const bool in_parts : {false, true}) {
    for (const int ranks : {1, 2, 3, 4, 7}) {
      for (const int per_host : {0, 1, 2}) {
        Addresses addresses;
        run_local_ranks({.size = ranks, .ranks_per_host = per_host}, [&](Communicator& comm) {
          const Scene scene = distribute_scene(comm, [&] { return load(in_parts); });
          EXPECT_EQ(content_hash(scene), content_hash(whole_));
          expect_texels(scene);
          addresses.add(scene);
          barrier(comm);  // addresses of memory that is given back come again
        });
        const int hosts = per_host == 0 ? 1 : (ranks + per_host - 1) / per_host;
        EXPECT_EQ(static_cast<int>(addresses.count()), hosts) << ranks << " ranks, " << per_host << " a host";
      }
    }
  }
}

TEST_F(TextureDistribution, PicturesAreReadWhenTheyAreLookedAt) {
  run_local_ranks(3, [&](Communicator& comm) {
    const Scene scene = distribute_scene(comm, [&] { return load(true); });
    ASSERT_TRUE(scene.texel_store);
    for (std::size_t i = 0; i + 1 < kPictures; ++i) EXPECT_FALSE(scene.textures[i].image.is_here()) << i;
    EXPECT_TRUE(scene.textures.back().image.is_here()) << "every rank samples what gives light";
    barrier(comm);
    if (comm.rank() == 1) scene.textures[2].image.require();
    barrier(comm);
    for (std::size_t i = 0; i + 1 < kPictures; ++i) EXPECT_EQ(scene.textures[i].image.is_here(), i == 2) << i;
    barrier(comm);
    std::vector<std::jthread> threads;
    for (int thread = 0; thread < 4; ++thread) threads.emplace_back([&] { expect_texels(scene); });
  });
}

TEST_F(TextureDistribution, ReadingInPartsKeepsNoTexels) {
  const LoadedScene loaded = load(true);
  EXPECT_EQ(content_hash(loaded.scene), content_hash(whole_));
  std::size_t elsewhere = 0;
  for (std::size_t i = 0; i < kPictures; ++i) {
    EXPECT_EQ(loaded.sources.at(i) == nullptr, loaded.scene.textures[i].image.is_reachable()) << i;
    elsewhere += loaded.sources[i] ? 1U : 0U;
  }
  EXPECT_EQ(elsewhere, kPictures - 1);
  EXPECT_LT(memory_of(loaded.scene), 2 * kPictureBytes);
}

TEST_F(TextureDistribution, WhatIsUnusedForLongestGoesPastTheLimit) {
  run_local_ranks(2, [&](Communicator& comm) {
    const Scene scene = distribute_scene(comm, [&] {
      LoadedScene loaded = load(true);
      loaded.memory_limit = memory_of(loaded.scene) + 2 * kPictureBytes + 1000;  // room for two, on each of two
      return loaded;
    });
    const auto here = [&] {
      std::vector<std::size_t> numbers;
      for (std::size_t i = 0; i + 1 < kPictures; ++i) {
        if (scene.textures[i].image.is_kept()) numbers.push_back(i);
      }
      return numbers;
    };
    const auto frame = [&](const std::vector<std::size_t>& used) {
      scene.texel_store->forget_unused();
      for (const std::size_t i : used) {
        EXPECT_TRUE(std::ranges::equal(scene.textures[i].image.pixels(), scene_.textures[i].image.pixels())) << i;
      }
      barrier(comm);
    };
    frame({0, 1, 2, 3});
    frame({1, 2, 3});
    frame({4});  // room for four of these five
    frame({4});
    EXPECT_EQ(here(), (std::vector<std::size_t>{1, 2, 3, 4}));
    frame({0, 1, 2, 3, 4, 5, 6});  // a frame may use more than there is room for
    EXPECT_EQ(here().size(), 7U);
    barrier(comm);
    frame({0});
    EXPECT_EQ(here(), (std::vector<std::size_t>{0, 3, 4, 5, 6}));
    barrier(comm);
    expect_texels(scene);
  });
}

/// A rank of a host that does not see the scene's files.
class BlindCommunicator final : public ForwardingCommunicator {
 public:
  using ForwardingCommunicator::ForwardingCommunicator;
  using ForwardingCommunicator::receive;

  [[nodiscard]] std::vector<std::byte> receive(int from) override {
    auto message = inner().receive(from);
    const std::string name = "scene.glb";
    const auto same = [](std::byte byte, char letter) { return byte == static_cast<std::byte>(letter); };
    for (auto at = message.begin();; at += std::ssize(name)) {
      at = std::search(at, message.end(), name.begin(), name.end(), same);
      if (at == message.end()) return message;
      *at = std::byte{'_'};
    }
  }
};

TEST_F(TextureDistribution, HostsThatDoNotSeeTheFilesGetThePictures) {
  for (const int per_host : {1, 2}) {
    run_local_ranks({.size = 4, .ranks_per_host = per_host}, [&](Communicator& comm) {
      BlindCommunicator blind(comm);
      const Scene scene = distribute_scene(comm.rank() == 3 ? blind : comm, [&] { return load(true); });
      ASSERT_TRUE(scene.texel_store);
      barrier(comm);
      if (comm.rank() == 0) std::filesystem::remove(path_);  // nobody needs it now
      barrier(comm);
      expect_texels(scene);
    });
    const std::vector<std::byte> file = encode_glb(scene_);
    folder_.write("scene.glb", {reinterpret_cast<const char*>(file.data()), file.size()});
  }
}

TEST_F(TextureDistribution, PicturesThatChangedAreAnError) {
  for (const bool is_gone : {false, true}) {
    const ExitCode expected = is_gone ? ExitCode::Io : ExitCode::BadInput;
    const std::string picture = path_.string() + ": images[1]: ";
    const std::string text =
        picture + (is_gone ? "cannot read '" + path_.string() + "'" : "the picture changed while the scene was used");
    expect_error_on_all(3, expected, text, [&](Communicator& comm) {
      const Scene scene = distribute_scene(comm, [&] { return load(true); });
      barrier(comm);
      if (comm.rank() == 0) {
        const auto size = std::filesystem::file_size(path_);
        std::filesystem::remove(path_);
        if (!is_gone) folder_.write("scene.glb", std::string(size, 'x'));
      }
      barrier(comm);
      agree_on_failure(comm, [&] { scene.textures[1].image.require(); });
    });
    const std::vector<std::byte> file = encode_glb(scene_);
    folder_.write("scene.glb", {reinterpret_cast<const char*>(file.data()), file.size()});
  }
}

TEST_F(TextureDistribution, PicturesThatDecodeToOtherTexelsAreAnError) {
  expect_error_on_all(3, ExitCode::BadInput, path_.string() + ": images[1]: decodes to other texels on this host",
                      [&](Communicator& comm) {
                        const Scene scene = distribute_scene(comm, [&] {
                          LoadedScene loaded = load(true);
                          Texels& image = loaded.scene.textures[1].image;
                          TexelFacts others = image.facts();
                          ++others.content;
                          image = Texels(image.size(), others);
                          return loaded;
                        });
                        agree_on_failure(comm, [&] { scene.textures[1].image.require(); });
                      });
}

TEST_F(TextureDistribution, ABrokenPictureIsLeftOutEitherWay) {
  std::vector<std::byte> file = encode_glb(scene_);
  const std::string start = "\x89PNG";
  const auto same = [](std::byte byte, char letter) { return byte == static_cast<std::byte>(letter); };
  auto at = std::search(file.begin(), file.end(), start.begin(), start.end(), same);
  at = std::search(at + 1, file.end(), start.begin(), start.end(), same);
  ASSERT_NE(at, file.end());
  std::fill_n(at + 60, 200, std::byte{0});
  folder_.write("scene.glb", {reinterpret_cast<const char*>(file.data()), file.size()});
  const Scene whole = load(false).scene;
  EXPECT_EQ(whole.textures.size(), kPictures - 1);
  run_local_ranks(3, [&](Communicator& comm) {
    const Scene scene = distribute_scene(comm, [&] { return load(true); });
    EXPECT_EQ(content_hash(scene), content_hash(whole));
    EXPECT_EQ(scene.warnings, whole.warnings);
    for (std::size_t i = 0; i < whole.textures.size(); ++i) {
      EXPECT_TRUE(std::ranges::equal(scene.textures[i].image.pixels(), whole.textures[i].image.pixels())) << i;
    }
  });
}

}  // namespace
}  // namespace hpr
