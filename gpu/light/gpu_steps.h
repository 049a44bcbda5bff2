#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "gpu/device/gpu_batch.h"
#include "gpu/device/gpu_device.h"
#include "gpu/device/gpu_kernel.h"
#include "rt/passes/pass_list.h"
#include "rt/ray_counts.h"

namespace hpr {

/// A kernel of some that run one after the other.
struct GpuStep {
  std::string_view name;  ///< as times have it
  std::span<const std::uint32_t> shader;
  std::span<const std::uint32_t> plain_shader;  ///< for scenes without extensions of materials
  std::optional<PassId> pass = {};              ///< runs only where this one does
};

/// What a scene and its plan make of steps.
struct GpuStepTraits {
  bool extended = false;      ///< some material has extensions
  std::uint32_t variant = 0;  ///< see GpuKernel
  std::uint64_t input = 0;    ///< address of what all steps read
  std::span<const PassPlan> plan = {};
};

/// Steps that run one after the other, again and again, by the same input, and how long the device was at each.
class GpuSteps {
 public:
  /// Software devices compile the kernels here. What `traits` point to must be there by then, and outlive this.
  GpuSteps(const GpuDevice& device, std::span<const GpuStep> steps, const GpuStepTraits& traits);

  /// Records a step, unless its pass does not run: for `threads` threads, which find `count` and `round` beside the
  /// input.
  void run(std::size_t step, std::size_t threads, std::size_t count, std::uint32_t round = 0);
  /// Records what is neither.
  [[nodiscard]] GpuBatch& batch() { return batch_; }
  /// Does what was recorded, and waits for it.
  void finish();

  /// By step, since clear_times().
  [[nodiscard]] std::span<const PassTime> times() const { return times_; }
  void clear_times();

 private:
  std::uint64_t input_;
  std::vector<const GpuKernel*> kernels_ = {};  ///< by step; null where its pass does not run
  std::vector<PassTime> times_ = {};            ///< by step
  GpuBatch batch_;
};

}  // namespace hpr
