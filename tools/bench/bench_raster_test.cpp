#include "tools/bench/bench_raster.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <vector>

#include "raster/rasterizer.h"
#include "scene/view.h"
#include "tools/bench/bench.h"

namespace hpr {
namespace {

std::size_t covered(const TileLayer<Key>& layer) {
  const auto keys = layer.run({0, layer.tiles()});
  return keys.size() - static_cast<std::size_t>(std::ranges::count(keys, kNoKey));
}

TEST(BareGl, DrawsAndReadsWhatTheRasterizerDoesInTurnWithIt) {
  constexpr Size kSize{300, 200};
  Scene scene;
  scene.meshes.push_back(displaced_sphere(40, 40));
  scene.instances.push_back({});
  finish_scene(scene);
  const View view = make_view(look_at({0.3, 0.4, 3.2}, {0.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, 0.7), kSize, scene.bounds);
  const auto context = make_gl_context({});
  Rasterizer rasterizer(*context, scene, std::array{SurfaceRange{0, scene.triangles}}, 1);
  const Mesh& mesh = scene.meshes.front();
  for (const KeyRoute route : all_key_routes()) {
    context->make_current();
    BareGl bare(*context, mesh.positions, mesh.triangles, glm::mat4(clip_from_world(view, {0.0, 0.0, 0.0})), kSize,
                route);
    for (int turn = 0; turn < 2; ++turn) {
      TileLayer<Key> expected(FrameLayout({kSize}));
      TileLayer<Key> layer(expected.layout());
      rasterizer.draw(view, 0, std::array{view.block}, expected);
      pack_keys(std::array{bare.frame()}, view.block, 0, layer, 1);
      EXPECT_GT(covered(expected), 10000U);
      EXPECT_NEAR(static_cast<double>(covered(layer)), static_cast<double>(covered(expected)), 20.0)
          << route_name(route);
    }
  }
}

}  // namespace
}  // namespace hpr
