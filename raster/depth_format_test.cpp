#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "raster/raster_test_scenes.h"
#include "raster/rasterizer.h"

namespace hpr {
namespace {

using namespace test;

class DepthFormatTest : public testing::TestWithParam<std::string> {
 protected:
  std::unique_ptr<GlContext> context_ = make_gl_context({.backend = GetParam()});
};

INSTANTIATE_TEST_SUITE_P(Backends, DepthFormatTest, testing::ValuesIn(all_gl_backends()),
                         [](const auto& each) { return each.param; });

std::vector<Key> drawn(Rasterizer& rasterizer, const View& view, DepthFormat format) {
  TileLayer<Key> layer(FrameLayout({view.size()}));
  layer.set_depth_format(format);
  rasterizer.draw(view, 0, std::array{Rect{0, 0, view.size().width, view.size().height}}, layer);
  const auto keys = layer.run({0, layer.tiles()});
  return {keys.begin(), keys.end()};
}

TEST_P(DepthFormatTest, DepthsAreThoseOfTheFloatsRounded) {
  const Scene scene = mixed_scene();
  const View view = perspective_view({240, 160});
  Rasterizer rasterizer(*context_, scene, std::array{SurfaceRange{0, scene.triangles}}, 1);
  const std::vector<Key> exact = drawn(rasterizer, view, DepthFormat::Float32);
  for (const DepthFormat format : {DepthFormat::Bits24, DepthFormat::Bits16}) {
    const std::vector<Key> rounded = drawn(rasterizer, view, format);
    std::size_t wrong = 0;
    std::size_t other = 0;
    for (std::size_t i = 0; i < exact.size(); ++i) {
      wrong += key_depth(rounded[i]) != quantized_depth(key_depth(exact[i]), format) ? 1U : 0U;
      other += key_surface(rounded[i]) != key_surface(exact[i]) ? 1U : 0U;
    }
    EXPECT_EQ(wrong, 0U) << lost_bits(format);
    EXPECT_LT(other, exact.size() / 100);
  }
  EXPECT_TRUE(drawn(rasterizer, view, DepthFormat::Float32) == exact);  // and back again
}

TEST_P(DepthFormatTest, PartsMergedByMaximumHaveTheKeysOfTheWhole) {
  const Scene scene = mixed_scene();
  const View view = perspective_view({240, 160});
  Rasterizer whole(*context_, scene, std::array{SurfaceRange{0, scene.triangles}}, 1);
  const std::uint32_t third = scene.triangles / 3;
  Rasterizer outer(*context_, scene, std::array{SurfaceRange{0, third}, SurfaceRange{2 * third, scene.triangles}}, 1);
  Rasterizer inner(*context_, scene, std::array{SurfaceRange{third, 2 * third}}, 1);
  for (const DepthFormat format : {DepthFormat::Bits24, DepthFormat::Bits16}) {
    std::vector<Key> merged = drawn(outer, view, format);
    std::ranges::transform(merged, drawn(inner, view, format), merged.begin(),
                           [](Key a, Key b) { return std::max(a, b); });
    EXPECT_TRUE(merged == drawn(whole, view, format)) << lost_bits(format);
  }
}

}  // namespace
}  // namespace hpr
