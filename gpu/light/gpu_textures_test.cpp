#include "gpu/light/gpu_textures.h"

#include <hpr/shaders/texture_samples.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec4.hpp>
#include <limits>
#include <random>
#include <span>
#include <vector>

#include "gpu/device/test_kernels.h"
#include "gpu/light/test_scenes.h"
#include "rt/materials/material_point.h"

namespace hpr {
namespace {

using GpuTexturesTest = test::OnGpu;

/// As texture_samples.comp reads them.
struct TextureUse {
  TextureRef reference;
  std::uint32_t encoding = 0;
  std::uint32_t padding = 0;
  std::array<glm::vec2, 2> uv{};
  glm::dvec2 plain_uv{0.0};
};

/// As texture_samples.comp writes them.
struct TextureSamples {
  glm::dvec4 plain;
  glm::dvec4 texel;

  bool operator==(const TextureSamples&) const = default;
};

TEST_F(GpuTexturesTest, GiveTheCpusTexelsToTheBit) {
  test::Random random(11);
  const std::vector<Texture> textures = test::random_textures(random);
  const GpuTextures uploaded(device(), textures);
  std::vector<TextureUse> uses(100'000);
  for (TextureUse& use : uses) {
    use.reference = random.reference(textures.size());
    use.encoding = random.below(2);
    use.uv = {random.uv(), random.uv()};
    use.plain_uv = {random.coordinate(), random.coordinate()};
  }
  const auto found = test::map_on_gpu<TextureSamples>(device(), texture_samples, std::span<const TextureUse>(uses),
                                                      uploaded.address());
  std::size_t mixed = 0;
  for (std::size_t i = 0; i < uses.size(); ++i) {
    const TextureUse& use = uses[i];
    const Texture& texture = textures.at(static_cast<std::size_t>(use.reference.texture));
    const auto encoding = static_cast<Encoding>(use.encoding);
    const glm::vec2& set = use.uv.at(std::min(use.reference.uv_set, 1U));
    const TextureSamples expected{sample_texture(texture, encoding, use.plain_uv),
                                  sample_texture(texture, encoding, transformed_uv(use.reference, set))};
    ASSERT_TRUE(found[i] == expected) << i << ": " << use.plain_uv.x << " " << use.plain_uv.y << ", " << set.x << " "
                                      << set.y;
    if (std::abs(std::remainder(255.0 * expected.texel.a, 1.0)) > 1e-3) ++mixed;
  }
  EXPECT_GT(mixed, uses.size() / 20);
}

}  // namespace
}  // namespace hpr
