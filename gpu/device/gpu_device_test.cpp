#include "gpu/device/gpu_device.h"

#include <hpr/shaders/add_numbers.h>
#include <hpr/shaders/count_until_odd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "gpu/device/gpu_batch.h"
#include "gpu/device/test_gpu.h"

namespace hpr {
namespace {

using GpuWork = test::OnGpu;

GpuInfo gpu(int index, const std::string& name, bool software, const std::string& lacks = {}) {
  GpuInfo info;
  info.index = index;
  info.name = name;
  info.software = software;
  info.discrete = !software;
  info.uuid.front() = static_cast<std::uint8_t>(index);
  info.lacks = lacks;
  return info;
}

/// Two GPUs, one that cannot compute, and the CPU.
std::vector<GpuInfo> machine() {
  return {gpu(0, "CPU", true), gpu(1, "old", false, "shaderInt64"), gpu(2, "first", false), gpu(3, "second", false)};
}

TEST(ChooseGpu, RanksOfAHostHaveOneEach) {
  const std::vector<GpuInfo> gpus = machine();
  for (const bool software : {false, true}) {
    for (const int rank : {0, 1, 2, 3}) {
      const GpuInfo chosen = choose_gpu(gpus, {.local_rank = rank, .software = software});
      EXPECT_EQ(chosen.index, rank % 2 == 0 ? 2 : 3) << rank;
    }
  }
}

TEST(ChooseGpu, CardsComeBeforeSharedMemoryAndOneOfTwoDriversIsEnough) {
  std::vector<GpuInfo> gpus = machine();
  gpus[2].discrete = false;
  for (const int rank : {0, 1, 2}) EXPECT_EQ(choose_gpu(gpus, {.local_rank = rank}).index, 3);
  gpus[3].discrete = false;
  EXPECT_EQ(choose_gpu(gpus, {.local_rank = 1}).index, 3);
  gpus[3].uuid = gpus[2].uuid;
  for (const int rank : {0, 1, 2}) EXPECT_EQ(choose_gpu(gpus, {.local_rank = rank}).index, 2);
}

TEST(ChooseGpu, TheCpuDoesItsWorkOnlyWhereThatIsAskedFor) {
  const std::vector<GpuInfo> cpu_alone{machine().front()};
  EXPECT_EQ(choose_gpu(cpu_alone, {.software = true}).index, 0);
  EXPECT_EQ(choose_gpu(cpu_alone, {.device = 0}).index, 0);
  for (const std::vector<GpuInfo>& gpus : {cpu_alone, std::vector<GpuInfo>{}}) {
    try {
      (void)choose_gpu(gpus, {});
      FAIL();
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::NoDevice);
      EXPECT_NE(std::string(error.what()).find(gpus.empty() ? "devices: none" : "0: CPU (software)"), std::string::npos)
          << error.what();
    }
  }
}

TEST(ChooseGpu, WhatCannotBeHadIsSaidWithWhatThereIs) {
  const auto code = [](int device) {
    try {
      (void)choose_gpu(machine(), {.device = device});
      return ExitCode::Done;
    } catch (const Error& error) {
      EXPECT_NE(error.hint().find("1: old (lacks shaderInt64)"), std::string::npos) << error.hint();
      return error.code();
    }
  };
  EXPECT_EQ(code(3), ExitCode::Done);
  EXPECT_EQ(code(1), ExitCode::NoDevice);
  EXPECT_EQ(code(4), ExitCode::Usage);
}

struct Added {
  std::uint64_t numbers;
  std::uint64_t count;
  std::uint64_t added;
};

TEST_F(GpuWork, LaterWorkSeesWhatWasWrittenBefore) {
  constexpr std::size_t kCount = 1001;  // no whole number of groups
  const GpuBuffer up(device(), kCount * 8, GpuMemory::Upload);
  const GpuBuffer there(device(), (kCount + 1) * 8, GpuMemory::Device);
  const GpuBuffer down(device(), (kCount + 1) * 8, GpuMemory::Readback);
  EXPECT_TRUE(there.mapped().empty());
  const GpuKernel add(device(), add_numbers, sizeof(Added));
  GpuBatch batch(device());
  for (std::uint64_t round = 0; round < 3; ++round) {
    for (std::size_t i = 0; i < kCount; ++i) up.mapped<std::uint64_t>()[i] = (round << 40U) + i;
    batch.begin_pass("up");
    batch.fill(there, 0x01020304);
    batch.copy(up, there, kCount * 8);
    batch.begin_pass("add");
    for (std::uint64_t k = 1; k <= 10; ++k) batch.run(add, kCount, Added{there.address(), kCount, k});
    batch.run(add, 0, Added{0, 1, 1});  // nothing to do
    batch.begin_pass("down");
    batch.copy(there, down, down.bytes());
    batch.submit();
    batch.wait();
    const std::span<const std::uint64_t> found = down.mapped<const std::uint64_t>();
    for (std::size_t i = 0; i < kCount; ++i) ASSERT_EQ(found[i], (round << 40U) + i + 55) << i;
    EXPECT_EQ(found[kCount], 0x0102030401020304U);  // threads beyond the last number wrote nothing
    if (device().timestamp_ns() > 0.0) {
      ASSERT_EQ(batch.times().size(), 3U);
      EXPECT_EQ(batch.times()[1].pass, "add");
      for (const GpuPassTime& time : batch.times()) EXPECT_GE(time.ms, 0.0);
    }
  }
}

TEST_F(GpuWork, MoreGroupsThanGoInARowAreRun) {
  constexpr std::uint64_t kCount = 65'535ULL * kGroupThreads + 100;
  const GpuBuffer numbers(device(), kCount * 8, GpuMemory::Readback);
  const GpuKernel add(device(), add_numbers, sizeof(Added));
  GpuBatch batch(device());
  batch.fill(numbers, 0);
  batch.run(add, kCount, Added{numbers.address(), kCount, 3});
  batch.submit();
  batch.wait();
  EXPECT_TRUE(std::ranges::all_of(numbers.mapped<const std::uint64_t>(), [](std::uint64_t n) { return n == 3; }));
}

TEST_F(GpuWork, KernelsAreMadeOnce) {
  const GpuKernel& add = device().kernel(add_numbers, sizeof(Added));
  EXPECT_EQ(&device().kernel(add_numbers, sizeof(Added)), &add);
  EXPECT_NE(&device().kernel(add_numbers, sizeof(Added), 1), &add);
  EXPECT_NE(&device().kernel(count_until_odd, sizeof(std::uint64_t)), &add);
}

TEST_F(GpuWork, MemoryThatIsNotThereIsALimit) {
  try {
    const GpuBuffer huge(device(), device().info().memory + (std::size_t{1} << 20U), GpuMemory::Device);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Limit) << error.what();
    EXPECT_NE(std::string(error.what()).find("while allocating"), std::string::npos) << error.what();
  }
}

/// Work of a device on the CPU that takes until it is told to end.
class EndlessWork {
 public:
  explicit EndlessWork(const GpuDevice& device)
      : number_(device, 4, GpuMemory::Readback),
        kernel_(device, count_until_odd, sizeof(std::uint64_t)),
        batch_(std::make_unique<GpuBatch>(device)) {
    number_.mapped<std::uint32_t>()[0] = 0;
    // Software devices end each thread's loops after 65 535 turns: only many threads take long.
    batch_->run(kernel_, std::uint64_t{1} << 22U, number_.address());
    batch_->submit();
  }
  ExitCode wait(int limits = 1) {
    try {
      batch_->wait(limits);
      return ExitCode::Done;
    } catch (const Error& error) {
      return error.code();
    }
  }
  void end() { __atomic_fetch_or(&number_.mapped<std::uint32_t>()[0], 1U, __ATOMIC_RELAXED); }
  void leave() { batch_.reset(); }

 private:
  GpuBuffer number_;
  GpuKernel kernel_;
  std::unique_ptr<GpuBatch> batch_;
};

/// On a device on the CPU: a GPU's watchdog would end such work, and need not see what the CPU writes.
class GpuErrors : public testing::Test {
 protected:
  void SetUp() override {
    if (test::usable_gpu(true) < 0) GTEST_SKIP() << "no device on the CPU";
  }
  static GpuOptions with_limit(int seconds) {
    return {.device = test::usable_gpu(true), .limit = std::chrono::seconds(seconds)};
  }
};

TEST_F(GpuErrors, WorkThatDoesNotEndIsGivenUpAndMayBeWaitedForAgain) {
  const GpuDevice device(with_limit(2));
  EndlessWork work(device);
  EXPECT_EQ(work.wait(), ExitCode::Hang);
  work.end();
  EXPECT_EQ(work.wait(), ExitCode::Done);
}

TEST_F(GpuErrors, WorkMayBeWaitedForLongerThanTheLimit) {
  const GpuDevice device(with_limit(1));
  EndlessWork work(device);
  std::thread ends([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(1300));
    work.end();
  });
  EXPECT_EQ(work.wait(60), ExitCode::Done);
  ends.join();
}

TEST_F(GpuErrors, ADeviceWhoseWorkDoesNotEndIsLeftAsItIs) {
  const auto device = std::make_unique<GpuDevice>(with_limit(1));
  EndlessWork work(*device);
  EXPECT_EQ(work.wait(), ExitCode::Hang);
  work.leave();
  EXPECT_TRUE(device->is_given_up());
  work.end();
}

TEST(GpuErrorCodes, ADeviceThatIsLostOrSilentIsNamed) {
  if (test::usable_gpu() < 0) GTEST_SKIP() << "no device that Vulkan can compute on";
  const GpuDevice device({.software = true});
  struct Case {
    VkResult result;
    ExitCode code;
  };
  for (const Case& each :
       {Case{VK_ERROR_DEVICE_LOST, ExitCode::NoDevice}, Case{VK_TIMEOUT, ExitCode::Hang},
        Case{VK_ERROR_OUT_OF_DEVICE_MEMORY, ExitCode::Limit}, Case{VK_ERROR_FRAGMENTED_POOL, ExitCode::Internal}}) {
    try {
      device.check(each.result, "testing");
      FAIL();
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), each.code);
      EXPECT_NE(std::string(error.what()).find(device.info().name), std::string::npos) << error.what();
    }
  }
  EXPECT_NO_THROW(device.check(VK_SUCCESS, "testing"));
}

}  // namespace
}  // namespace hpr
