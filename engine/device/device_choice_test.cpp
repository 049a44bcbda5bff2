#include "engine/device/device_choice.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "core/error.h"
#include "scene/scene.h"

namespace hpr {
namespace {

using State = DeviceOffer::State;

GpuInfo gpu(int index, bool software, const std::string& lacks = {}) {
  GpuInfo info;
  info.index = index;
  info.name = software ? "llvmpipe" : "card " + std::to_string(index);
  info.software = software;
  info.discrete = !software;
  info.uuid.front() = static_cast<std::uint8_t>(index);
  info.lacks = lacks;
  return info;
}

TEST(DeviceOffer, IsReadyWhereAGpuCanDoAllThatKernelsNeed) {
  EXPECT_EQ(offer_of({gpu(0, true), gpu(1, false)}, "a").state, State::Ready);
  EXPECT_EQ(offer_of({gpu(0, false, "shaderFloat64"), gpu(1, false)}, "a").state, State::Ready);
  EXPECT_EQ(offer_of({}, "a").state, State::None);
  EXPECT_EQ(offer_of({gpu(0, true)}, "a").state, State::None) << "software is no GPU";
  const DeviceOffer lacking = offer_of({gpu(0, true), gpu(1, false, "shaderFloat64")}, "a");
  EXPECT_EQ(lacking.state, State::Lacking);
  EXPECT_EQ(lacking.problem, "card 1 lacks shaderFloat64");
}

TEST(DeviceOffer, HasTheGpuOfTheLocalRankStarted) {
  const std::vector<GpuInfo> two{gpu(0, true), gpu(1, false), gpu(2, false)};
  for (const int rank : {0, 1, 2, 3}) {
    int started = -1;
    const DeviceOffer offer =
        start_offered("a", rank, [&](const GpuDevice::Choose& choose) { started = choose(two).index; });
    EXPECT_EQ(offer.state, State::Ready) << offer.problem;
    EXPECT_EQ(started, 1 + rank % 2);
  }
}

TEST(DeviceOffer, SaysWhatWentWrong) {
  const DeviceOffer failed = start_offered("a", 0, [](const GpuDevice::Choose& choose) {
    (void)choose({gpu(1, false)});
    throw Error(ExitCode::Limit, "card 1 has no memory left");
  });
  EXPECT_EQ(failed.state, State::Failed);
  EXPECT_EQ(failed.problem, "card 1 has no memory left");
  const DeviceOffer without =
      start_offered("b", 0, [](const GpuDevice::Choose&) { throw Error(ExitCode::NoDevice, "no libvulkan"); });
  EXPECT_EQ(without.state, State::None);
  EXPECT_EQ(without.host, "b");
  bool started = false;
  const DeviceOffer lacking = start_offered("a", 0, [&](const GpuDevice::Choose& choose) {
    (void)choose({gpu(0, false, "shaderInt64")});
    started = true;
  });
  EXPECT_EQ(lacking.state, State::Lacking);
  EXPECT_FALSE(started);
}

DeviceOffer ready(const std::string& host) {
  return {State::Ready, host};
}

TEST(DeviceChoice, IsMadeForAllRanksAlike) {
  const DeviceOffer none{State::None, "b", "no GPU that Vulkan knows"};
  const DeviceOffer lacking{State::Lacking, "c", "card lacks shaderInt64"};
  const DeviceOffer failed{State::Failed, "d", "no memory left"};
  EXPECT_TRUE(choose_devices(std::vector{ready("a")}).uses);
  EXPECT_TRUE(choose_devices(std::vector{ready("a"), ready("b")}).uses);

  const DeviceChoice without = choose_devices(std::vector{none, none});
  EXPECT_FALSE(without.uses);
  EXPECT_TRUE(without.why.empty() && !without.is_warning) << "a machine without a GPU works in silence";

  const DeviceChoice mixed = choose_devices(std::vector{ready("a"), none});
  EXPECT_FALSE(mixed.uses);
  EXPECT_TRUE(mixed.is_warning);
  EXPECT_EQ(mixed.why, "no GPU of rank 1 on b (no GPU that Vulkan knows), and all ranks of a picture need one");

  const DeviceChoice old = choose_devices(std::vector{lacking});
  EXPECT_FALSE(old.uses || old.is_warning);
  EXPECT_EQ(old.why, "no GPU (card lacks shaderInt64)");
  EXPECT_TRUE(choose_devices(std::vector{lacking, ready("a")}).is_warning);

  const DeviceChoice broken = choose_devices(std::vector{ready("a"), none, failed});
  EXPECT_FALSE(broken.uses);
  EXPECT_TRUE(broken.is_warning);
  EXPECT_EQ(broken.why, "the GPU of rank 2 on d (no memory left) does not start");
  EXPECT_EQ(choose_devices(std::vector{failed}).why, "the GPU (no memory left) does not start");
}

DeviceOfRank rank_on(const std::string& host, std::uint8_t card, bool software = false) {
  DeviceOfRank rank{.host = host, .software = software};
  rank.uuid.front() = card;
  return rank;
}

TEST(DeviceCrowding, IsSaidWhereRanksOfAHostHaveToShareGpus) {
  EXPECT_EQ(describe_crowding({}), "");
  EXPECT_EQ(describe_crowding(std::vector{rank_on("a", 1), rank_on("a", 2), rank_on("b", 1)}), "");
  EXPECT_EQ(describe_crowding(std::vector{rank_on("a", 1, true), rank_on("a", 1, true)}), "") << "CPUs are no cards";
  const std::string one = describe_crowding(std::vector{rank_on("a", 1), rank_on("a", 1), rank_on("a", 1)});
  EXPECT_NE(one.find("3 ranks on a use 1 GPU together"), std::string::npos) << one;
  EXPECT_NE(one.find("--ranks 1 "), std::string::npos) << one;
  const std::string two =
      describe_crowding(std::vector{rank_on("b", 1), rank_on("b", 2), rank_on("b", 1), rank_on("c", 1)});
  EXPECT_NE(two.find("3 ranks on b use 2 GPUs together"), std::string::npos) << two;
  EXPECT_NE(two.find("--ranks 3 "), std::string::npos) << two;
}

TEST(DeviceBytes, GrowWithAllThatIsPutThere) {
  Scene scene;
  Mesh& mesh = scene.meshes.emplace_back();
  mesh.positions.assign(1000, glm::vec3(0.0F));
  mesh.triangles.assign(2000, glm::uvec3(0, 1, 2));
  scene.instances.push_back({});
  finish_scene(scene);
  const std::uint64_t bare = device_bytes_of(scene);
  EXPECT_GE(bare, 2000U * 100 + 1000U * 24);
  EXPECT_LE(bare, 2000U * 400 + 1000U * 100) << "a card would be refused for nothing";
  scene.meshes.front().normals.assign(1000, glm::vec3(0.0F));
  const std::uint64_t with_normals = device_bytes_of(scene);
  EXPECT_EQ(with_normals, bare + 12'000);
  scene.instances.resize(101, scene.instances.front());
  EXPECT_LE(device_bytes_of(scene), with_normals + 100 * 2000) << "instances have no triangles of their own";
}

}  // namespace
}  // namespace hpr
