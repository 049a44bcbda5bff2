#include "cluster/distribution/scene_distribution.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <mutex>
#include <new>
#include <stdexcept>
#include <string>

#include "cluster/distribution/assignment.h"
#include "cluster/transport/communicator_wrappers.h"
#include "cluster/transport/local_communicator.h"
#include "cluster/transport/test_communicator.h"
#include "core/error.h"
#include "scene/pages/part_pages.h"
#include "scene/partial_mesh.h"

namespace hpr {
namespace {

using test::expect_error_on_all;

Scene small_scene() {
  Scene scene;
  scene.name = "small";
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.normals.assign(3, {0, 0, 1});
  mesh.triangles = {{0, 1, 2}};
  scene.meshes = {mesh};
  scene.instances.resize(3);
  finish_scene(scene);
  return scene;
}

/// Changes the last byte of long messages this rank receives: a broken network or build.
class DamagingCommunicator final : public ForwardingCommunicator {
 public:
  using ForwardingCommunicator::ForwardingCommunicator;
  using ForwardingCommunicator::receive;

  [[nodiscard]] std::vector<std::byte> receive(int from) override {
    auto message = inner().receive(from);
    if (message.size() > 200) message.back() ^= std::byte{1};
    return message;
  }
};

TEST(DistributeScene, EveryRankHoldsTheSceneOfRankZero) {
  const std::uint64_t expected = content_hash(small_scene());
  for (int size = 1; size <= 9; ++size) {
    std::atomic<int> loads = 0;
    run_local_ranks(size, [&](Communicator& comm) {
      const Scene scene = distribute_scene(comm, [&] {
        ++loads;
        return small_scene();
      });
      EXPECT_EQ(content_hash(scene), expected);
      EXPECT_EQ(scene.triangles, 3U);
    });
    EXPECT_EQ(loads, 1);
  }
}

TEST(DistributeScene, AnErrorOfRankZeroReachesEveryoneWhole) {
  for (const int size : {1, 2, 5}) {
    std::atomic<int> thrown = 0;
    run_local_ranks(size, [&](Communicator& comm) {
      try {
        (void)distribute_scene(
            comm, []() -> Scene { throw Error(ExitCode::Io, "no such file", "check the path", "line 3"); });
      } catch (const Error& error) {
        EXPECT_EQ(error.code(), ExitCode::Io);
        EXPECT_STREQ(error.what(), "no such file");
        EXPECT_EQ(error.hint(), "check the path");
        EXPECT_EQ(error.line(), "line 3");
        ++thrown;
      }
    });
    EXPECT_EQ(thrown, size);
  }
}

TEST(DistributeScene, OtherExceptionsBecomeErrorsOnEveryRank) {
  expect_error_on_all(3, ExitCode::Internal, "vector too long", [](Communicator& comm) {
    (void)distribute_scene(comm, []() -> Scene { throw std::length_error("vector too long"); });
  });
  expect_error_on_all(3, ExitCode::Limit, "out of memory", [](Communicator& comm) {
    (void)distribute_scene(comm, []() -> Scene { throw std::bad_alloc(); });
  });
}

TEST(DistributeScene, ARankThatHoldsAnotherSceneIsNamedOnEveryRank) {
  std::atomic<int> thrown = 0;
  run_local_ranks(4, [&](Communicator& comm) {
    DamagingCommunicator damaging(comm);
    try {
      // In a tree of four, rank 3 receives from rank 1 and passes nothing on.
      (void)distribute_scene(comm.rank() == 3 ? damaging : comm, small_scene);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::BadInput);
      EXPECT_NE(std::string(error.what()).find("rank 3 holds another scene"), std::string::npos) << error.what();
      ++thrown;
    }
  });
  EXPECT_EQ(thrown, 4);
}

/// A grid of quads; `vertices` of it along a side.
Mesh grid(std::uint32_t vertices, float z) {
  Mesh mesh;
  mesh.name = "grid";
  for (std::uint32_t y = 0; y < vertices; ++y) {
    for (std::uint32_t x = 0; x < vertices; ++x) {
      mesh.positions.emplace_back(static_cast<float>(x), static_cast<float>(y), z);
      mesh.normals.emplace_back(0.0F, 0.0F, 1.0F);
      if (x + 1 == vertices || y + 1 == vertices) continue;
      const std::uint32_t at = y * vertices + x;
      mesh.triangles.insert(mesh.triangles.end(),
                            {{at, at + 1, at + vertices}, {at + 1, at + vertices + 1, at + vertices}});
    }
  }
  return mesh;
}

/// A large mesh, one that two instances share, and a light.
Scene large_scene() {
  Scene scene;
  scene.materials.resize(2);
  scene.materials[1].emissive = glm::vec3(1.0F);
  scene.meshes = {grid(300, 0.0F), grid(40, 5.0F), grid(2, 9.0F)};
  scene.meshes[2].material = 1;
  scene.instances.resize(4);
  scene.instances[1].mesh = 1;
  scene.instances[2].mesh = 1;
  scene.instances[2].to_world[3].x = 100.0;
  scene.instances[3].mesh = 2;
  finish_scene(scene);
  return scene;
}

TEST(DistributeScene, RanksHoldPartsThatAreTheWholeTogether) {
  const Scene whole = large_scene();
  for (int size = 2; size <= 5; ++size) {
    std::mutex mutex;
    std::vector<int> holders(whole.triangles, 0);
    std::uint64_t held = 0;
    run_local_ranks(size, [&](Communicator& comm) {
      const Scene scene = distribute_scene(comm, [&] {
        LoadedScene loaded(large_scene());
        loaded.in_parts = true;
        return loaded;
      });
      EXPECT_EQ(content_hash(scene), content_hash(whole));
      EXPECT_EQ(whole_memory_of(scene), memory_of(whole));
      EXPECT_EQ(scene.triangles, whole.triangles);
      EXPECT_EQ(scene.parts, partition_objects(whole, size));
      EXPECT_FALSE(scene.meshes[2].partial);  // all ranks see its light
      const std::lock_guard lock(mutex);
      for (const SurfaceRange& range : scene.parts.at(static_cast<std::size_t>(comm.rank()))) {
        for (std::uint32_t id = range.first; id < range.last; ++id) {
          ++holders[id];
          const SurfaceLocation at = locate_surface(scene, id);
          const Mesh& mine = scene.mesh_of(scene.instances[at.instance]);
          const Mesh& theirs = whole.mesh_of(whole.instances[at.instance]);
          ASSERT_TRUE(mine.holds(at.triangle));
          for (int corner = 0; corner < 3; ++corner) {
            ASSERT_EQ(mine.positions[mine.triangle(at.triangle)[corner]],
                      theirs.positions[theirs.triangles[at.triangle][corner]]);
          }
        }
      }
      held += memory_of(scene);
    });
    EXPECT_EQ(std::ranges::count(holders, 1), whole.triangles) << size;
    // Vertices at borders and the mesh that two instances share are there more than once.
    EXPECT_LT(held, memory_of(whole) * 8 / 5) << size;
  }
}

TEST(DistributeScene, OneRankHoldsAllOfASceneThatWasReadInParts) {
  run_local_ranks(1, [&](Communicator& comm) {
    const Scene scene = distribute_scene(comm, [&] {
      LoadedScene loaded(large_scene());
      loaded.in_parts = true;
      const auto whole = std::make_shared<Scene>(loaded.scene);
      for (Mesh& mesh : loaded.scene.meshes) mesh = without_triangles(mesh);
      loaded.read_mesh = [whole](std::uint32_t mesh) {
        return std::make_unique<WholeMeshReader>(&whole->meshes.at(mesh));
      };
      return loaded;
    });
    EXPECT_FALSE(is_shared_out(scene));
    EXPECT_EQ(to_bytes(scene), to_bytes(large_scene()));
  });
}

TEST(DistributeScene, PartsThatNoRankMayHoldAreRefusedWithTheRanksThatCould) {
  const std::uint64_t bytes = memory_of(large_scene());
  const auto load = [&](std::uint64_t limit) {
    LoadedScene loaded(large_scene());
    loaded.in_parts = true;
    loaded.memory_limit = limit;
    return loaded;
  };
  std::atomic<int> refused = 0;
  run_local_ranks(2, [&](Communicator& comm) {
    try {
      (void)distribute_scene(comm, [&] { return load(bytes / 3); });
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::Limit);
      EXPECT_EQ(error.hint(), "use at least 4 ranks, keep pages of it on disk with --data paged, or raise --limit-mem");
      ++refused;
    }
  });
  EXPECT_EQ(refused, 2);
  run_local_ranks(4, [&](Communicator& comm) {
    EXPECT_LT(memory_of(distribute_scene(comm, [&] { return load(bytes / 3); })), bytes / 2);
  });
}

TEST(DistributeScene, PartsThatAreTooLargeGoPageByPageToTheDisk) {
  const Scene whole = large_scene();
  const std::uint64_t bytes = memory_of(whole);
  for (const int size : {1, 2, 3}) {
    std::mutex mutex;
    std::vector<int> holders(whole.triangles, 0);
    run_local_ranks(size, [&](Communicator& comm) {
      Scene scene = distribute_scene(comm, [&] {
        LoadedScene loaded(large_scene());
        loaded.in_parts = loaded.in_pages = true;
        loaded.memory_limit = 2 * bytes / (3 * static_cast<std::uint64_t>(size));
        return loaded;
      });
      EXPECT_EQ(content_hash(scene), content_hash(whole));
      EXPECT_LT(memory_of(scene), bytes / 50);
      ASSERT_TRUE(scene.part_pages);
      PartPages& pages = *scene.part_pages;
      EXPECT_TRUE(pages.size() == 24 || pages.size() == 25) << pages.size();  // what all hold takes a little
      EXPECT_GE(pages.max_resident(), 8U);                                    // sixteen of the same size would fit
      EXPECT_LE(pages.max_resident() * pages.bytes_of_largest(), 2 * bytes / (3 * static_cast<std::uint64_t>(size)));
      EXPECT_EQ(scene.pages.size(), pages.size() * static_cast<std::size_t>(size));
      const std::lock_guard lock(mutex);
      for (std::size_t page = 0; page < pages.size(); ++page) {
        const PageInUse use(scene, page);
        EXPECT_LT(memory_of(scene), bytes / static_cast<std::uint64_t>(size) / 8);
        for (const SurfaceRange& range : surfaces_of_page(scene, page)) {
          for (std::uint32_t id = range.first; id < range.last; ++id) {
            ++holders[id];
            const SurfaceLocation at = locate_surface(scene, id);
            ASSERT_TRUE(scene.mesh_of(scene.instances[at.instance]).holds(at.triangle));
          }
        }
      }
    });
    EXPECT_EQ(std::ranges::count(holders, 1), whole.triangles) << size;
  }
}

TEST(DistributeScene, PagesAreForPartsThatDoNotFit) {
  run_local_ranks(2, [&](Communicator& comm) {
    const Scene scene = distribute_scene(comm, [&] {
      LoadedScene loaded(large_scene());
      loaded.in_parts = loaded.in_pages = true;
      return loaded;
    });
    EXPECT_FALSE(scene.part_pages);
    EXPECT_EQ(scene.parts.size(), 2U);
  });
}

TEST(DistributeScene, AMeshThatCannotBeReadAgainIsAnErrorOnEveryRank) {
  expect_error_on_all(3, ExitCode::Io, "gone", [&](Communicator& comm) {
    (void)distribute_scene(comm, [&] {
      LoadedScene loaded(large_scene());
      loaded.in_parts = true;
      for (Mesh& mesh : loaded.scene.meshes) mesh = without_triangles(mesh);
      loaded.read_mesh = [](std::uint32_t) -> std::unique_ptr<MeshReader> { throw Error(ExitCode::Io, "gone"); };
      return loaded;
    });
  });
}

}  // namespace
}  // namespace hpr
