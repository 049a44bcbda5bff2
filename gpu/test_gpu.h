#pragma once

#include <gtest/gtest.h>

#include <memory>

#include "core/error.h"
#include "gpu/gpu_device.h"

namespace hpr::test {

/// A test on a device: a GPU where there is one, else on the CPU, under the eyes of the validation layer. Skipped
/// where Vulkan has no device at all.
class OnGpu : public testing::Test {
 protected:
  void SetUp() override {
    try {
      device_ = std::make_unique<GpuDevice>(GpuOptions{.software = true, .validate = true});
    } catch (const Error& error) {
      GTEST_SKIP() << error.what();
    }
  }
  void TearDown() override { EXPECT_EQ(device_ == nullptr ? 0 : device_->validation_errors(), 0U); }
  [[nodiscard]] GpuDevice& device() { return *device_; }

 private:
  std::unique_ptr<GpuDevice> device_;
};

}  // namespace hpr::test
