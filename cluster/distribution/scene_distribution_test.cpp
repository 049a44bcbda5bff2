#include "cluster/distribution/scene_distribution.h"

#include <gtest/gtest.h>

#include <atomic>
#include <new>
#include <stdexcept>
#include <string>

#include "cluster/transport/communicator_wrappers.h"
#include "cluster/transport/local_communicator.h"
#include "cluster/transport/test_communicator.h"
#include "core/error.h"

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

}  // namespace
}  // namespace hpr
