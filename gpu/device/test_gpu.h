#pragma once

#include <gtest/gtest.h>

#include <memory>

#include "core/error.h"
#include "gpu/device/gpu_device.h"

namespace hpr::test {

/// Whether Vulkan has a device here that can do hpr's work; `software`: one on the CPU. Its index, -1: none.
inline int usable_gpu(bool software_only = false) {
  try {
    for (const GpuInfo& gpu : find_gpus()) {
      if (gpu.lacks.empty() && (gpu.software || !software_only)) return gpu.index;
    }
  } catch (const Error&) {
    return -1;  // no Vulkan
  }
  return -1;
}

/// A test on a device: a GPU where there is one, else on the CPU, under the eyes of the validation layer. Skipped
/// where Vulkan has no device at all.
class OnGpu : public testing::Test {
 protected:
  void SetUp() override {
    if (usable_gpu() < 0) GTEST_SKIP() << "no device that Vulkan can compute on";
    device_ =
        std::make_unique<GpuDevice>(GpuOptions{.software = true, .validate = true, .limit = std::chrono::seconds(90)});
    ASSERT_TRUE(device_->validates()) << "apt-get install vulkan-validationlayers";
  }
  void TearDown() override {
    if (device_ == nullptr) return;
    const auto errors = device_->validation_errors();
    device_.reset();  // what is left on it counts too
    EXPECT_EQ(*errors, 0U);
  }
  [[nodiscard]] GpuDevice& device() { return *device_; }

 private:
  std::unique_ptr<GpuDevice> device_;
};

}  // namespace hpr::test
