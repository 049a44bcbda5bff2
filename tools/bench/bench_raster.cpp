#include "tools/bench/bench_raster.h"

#include <fmt/format.h>

#include <array>
#include <cstdint>

#include "core/timing.h"
#include "raster/rasterizer.h"
#include "scene/view.h"
#include "tools/bench/bench_bare_gl.h"
#include "tools/bench/bench_scene.h"
#include "tools/bench/bench_times.h"

namespace hpr {
namespace {

constexpr Size kFrame{1920, 1080};
constexpr int kFrames = 15;

View view_of(const Scene& scene) {
  const Camera camera = look_at({0.3, 0.4, 3.2}, {0.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, 0.7);
  return make_view(camera, kFrame, scene.bounds);
}

BenchRow bench_sphere(GlContext& context, std::uint32_t rows, std::uint32_t columns, int threads) {
  Scene scene;
  scene.meshes.push_back(displaced_sphere(rows, columns));
  scene.instances.push_back({});
  finish_scene(scene);
  const View view = view_of(scene);
  TileLayer<Key> layer(FrameLayout({kFrame}));
  Rasterizer rasterizer(context, scene, std::array{SurfaceRange{0, scene.triangles}}, threads);
  const Mesh& mesh = scene.meshes.front();
  const glm::mat4 matrix(clip_from_world(view, {0.0, 0.0, 0.0}));
  BareGl bare(context, mesh.positions, mesh.triangles, matrix, kFrame);

  std::vector<double> ours;
  std::vector<double> floor;
  for (int frame = -2; frame < kFrames; ++frame) {  // two to warm up: shaders are compiled at the first draw
    layer.clear();
    Stopwatch watch;
    rasterizer.draw(view, 0, std::array{view.block}, layer);
    const double our_ms = watch.ms();
    watch.restart();
    bare.frame();
    const double bare_ms = watch.ms();
    if (frame < 0) continue;
    ours.push_back(our_ms);
    floor.push_back(bare_ms);
  }
  check_gl(context.gl(), "measuring");
  const double our_ms = median(ours);
  const double floor_ms = median(floor);
  return {fmt::format("keys of {} triangles, {}x{}", scene.triangles, kFrame.width, kFrame.height), our_ms, floor_ms,
          "ms", floor_ms / our_ms};
}

}  // namespace

std::vector<BenchRow> bench_raster(GlContext& context, int threads) {
  context.make_current();
  return {bench_sphere(context, 354, 354, threads), bench_sphere(context, 708, 708, threads)};
}

}  // namespace hpr
