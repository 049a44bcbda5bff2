#include <hpr/shaders/sampler_draws.h>

#include <array>
#include <cstdint>
#include <span>

#include "gpu/device/gpu_batch.h"
#include "gpu/device/test_gpu.h"
#include "rt/sampling/sampler.h"

namespace hpr {
namespace {

using GpuSampler = test::OnGpu;

/// As sampler_draws.comp writes them.
struct Draws {
  std::uint32_t one;
  std::array<std::uint32_t, 2> two;
  std::array<std::uint32_t, 2> of_pixel;
  std::array<std::uint32_t, 2> with_pixel;
  std::uint32_t branched;

  bool operator==(const Draws&) const = default;
};

std::uint32_t whole(double number) {
  return static_cast<std::uint32_t>(number * 4294967296.0);
}
std::array<std::uint32_t, 2> whole(const glm::dvec2& numbers) {
  return {whole(numbers.x), whole(numbers.y)};
}

Draws draws_of(std::uint32_t i, const RandomKey& key) {
  const auto x = static_cast<std::int32_t>(i * 2654435761U);
  Sampler sampler(pixel_stream(key, i % 7U, x, static_cast<std::int32_t>(i % 5000U) - 100), i ^ (i << 13U));
  Draws draws{};
  draws.of_pixel = whole(sampler.two_of_pixel());
  draws.with_pixel = whole(sampler.two_with_pixel());
  draws.one = whole(sampler.one());
  draws.two = whole(sampler.two());
  draws.branched = whole(sampler.branch(i % 3U).one());
  return draws;
}

TEST_F(GpuSampler, DrawsTheNumbersOfTheCpuToTheBit) {
  struct Constants {
    std::uint64_t found;
    std::uint64_t seed;
    std::uint64_t frame;
    std::uint32_t count;
    std::uint32_t padding;
  };
  constexpr std::uint32_t kCount = 100'000;
  const RandomKey key{.seed = 0x123456789ABCDEFU, .frame = 77};
  const GpuBuffer found(device(), kCount * sizeof(Draws), GpuMemory::Readback);
  const GpuKernel kernel(device(), sampler_draws, sizeof(Constants));
  GpuBatch batch(device());
  batch.run(kernel, kCount, Constants{found.address(), key.seed, key.frame, kCount, 0});
  batch.submit();
  batch.wait();
  const std::span<const Draws> draws = found.mapped<const Draws>();
  for (std::uint32_t i = 0; i < kCount; ++i) ASSERT_EQ(draws[i], draws_of(i, key)) << i;
}

}  // namespace
}  // namespace hpr
