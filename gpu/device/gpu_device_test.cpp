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

TEST(GpuErrors, WorkThatDoesNotEndIsGivenUpAndMayBeWaitedForAgain) {
  const int which = test::usable_gpu(true);  // a GPU's watchdog would end it, and need not see what the CPU writes
  if (which < 0) GTEST_SKIP() << "no device on the CPU";
  GpuDevice device({.device = which, .limit = std::chrono::seconds(2)});
  const GpuBuffer number(device, 4, GpuMemory::Readback);
  number.mapped<std::uint32_t>()[0] = 0;
  const GpuKernel endless(device, count_until_odd, sizeof(std::uint64_t));
  GpuBatch batch(device);
  // Software devices end each thread's loops after 65 535 turns: only many threads take long.
  batch.run(endless, std::uint64_t{1} << 22U, number.address());
  batch.submit();
  const auto code = [&] {
    try {
      batch.wait();
      return ExitCode::Done;
    } catch (const Error& error) {
      return error.code();
    }
  };
  EXPECT_EQ(code(), ExitCode::Hang);
  __atomic_fetch_or(&number.mapped<std::uint32_t>()[0], 1U, __ATOMIC_RELAXED);
  EXPECT_EQ(code(), ExitCode::Done);
}

TEST(GpuErrors, WorkMayBeWaitedForLongerThanTheLimit) {
  const int which = test::usable_gpu(true);
  if (which < 0) GTEST_SKIP() << "no device on the CPU";
  const GpuDevice device({.device = which, .limit = std::chrono::seconds(1)});
  const GpuBuffer number(device, 4, GpuMemory::Readback);
  number.mapped<std::uint32_t>()[0] = 0;
  const GpuKernel endless(device, count_until_odd, sizeof(std::uint64_t));
  GpuBatch batch(device);
  batch.run(endless, std::uint64_t{1} << 22U, number.address());
  batch.submit();
  std::thread ends([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(1300));
    __atomic_fetch_or(&number.mapped<std::uint32_t>()[0], 1U, __ATOMIC_RELAXED);
  });
  EXPECT_NO_THROW(batch.wait(60));
  ends.join();
}

TEST(GpuErrors, ADeviceWhoseWorkDoesNotEndIsLeftAsItIs) {
  const int which = test::usable_gpu(true);
  if (which < 0) GTEST_SKIP() << "no device on the CPU";
  const auto device = std::make_unique<GpuDevice>(GpuOptions{.device = which, .limit = std::chrono::seconds(1)});
  const GpuBuffer number(*device, 4, GpuMemory::Readback);
  std::uint32_t& counted = number.mapped<std::uint32_t>()[0];
  counted = 0;
  {
    const GpuKernel endless(*device, count_until_odd, sizeof(std::uint64_t));
    GpuBatch batch(*device);
    batch.run(endless, std::uint64_t{1} << 22U, number.address());
    batch.submit();
    EXPECT_THROW(batch.wait(), Error);
  }
  EXPECT_TRUE(device->is_given_up());
  __atomic_fetch_or(&counted, 1U, __ATOMIC_RELAXED);  // ends at last
}

TEST(GpuErrors, ADeviceThatIsLostOrSilentIsNamed) {
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
