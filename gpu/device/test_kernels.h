#pragma once

#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "gpu/device/gpu_batch.h"
#include "gpu/device/test_gpu.h"

namespace hpr::test {

/// What a test's shader makes of each of `inputs`: its constants are the addresses of inputs and results, `more`, and
/// their count.
template <typename Result, typename Input, typename... More>
std::vector<Result> map_on_gpu(const GpuDevice& device, std::span<const std::uint32_t> shader,
                               std::span<const Input> inputs, More... more) {
  static_assert(std::is_trivially_copyable_v<Result> && std::is_trivially_copyable_v<Input>);
  struct Constants {
    std::uint64_t inputs;
    std::uint64_t results;
    std::uint64_t more[sizeof...(More) + 1];  // NOLINT(modernize-avoid-c-arrays): the last one is the count
  };
  const GpuBuffer sent(device, inputs.size_bytes(), GpuMemory::Upload);
  std::ranges::copy(inputs, sent.mapped<Input>().begin());
  const GpuBuffer found(device, inputs.size() * sizeof(Result), GpuMemory::Readback);
  const GpuKernel kernel(device, shader, sizeof(Constants));
  GpuBatch batch(device);
  batch.run(kernel, inputs.size(), Constants{sent.address(), found.address(), {more..., inputs.size()}});
  batch.submit();
  batch.wait();
  const std::span<const Result> results = found.mapped<const Result>().first(inputs.size());
  return {results.begin(), results.end()};
}

}  // namespace hpr::test
