#include "raster/raster_speed.h"

#include <algorithm>
#include <array>
#include <vector>

#include "core/timing.h"
#include "raster/rasterizer.h"

namespace hpr {
namespace {

constexpr int kSide = 256;  ///< pixels of the screen
constexpr int kRepetitions = 7;

/// A square that fills the screen, as n^2 squares.
Scene grid_scene(std::uint32_t n) {
  Scene scene;
  Mesh& mesh = scene.meshes.emplace_back();
  for (std::uint32_t y = 0; y <= n; ++y) {
    for (std::uint32_t x = 0; x <= n; ++x) {
      const auto along = [n](std::uint32_t i) { return 2.0F * static_cast<float>(i) / static_cast<float>(n) - 1.0F; };
      mesh.positions.emplace_back(along(x), along(y), 0.0F);
    }
  }
  mesh.normals.assign(mesh.positions.size(), glm::vec3(0.0F, 0.0F, 1.0F));
  for (std::uint32_t y = 0; y < n; ++y) {
    for (std::uint32_t x = 0; x < n; ++x) {
      const std::uint32_t corner = y * (n + 1) + x;
      mesh.triangles.emplace_back(corner, corner + 1, corner + n + 1);
      mesh.triangles.emplace_back(corner + 1, corner + n + 2, corner + n + 1);
    }
  }
  scene.materials.emplace_back();
  scene.instances.push_back({});
  finish_scene(scene);
  return scene;
}

View straight_view() {
  View view;
  view.eye = {0.0, 0.0, 1.0};
  view.screen = {kSide, kSide};
  view.block = {0, 0, kSide, kSide};
  return view;
}

struct Repeated {
  double draw_ns = 0.0;
  double read_ns = 0.0;
  double spread = 1.0;  ///< the median by the least
};

double median_of(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

Repeated repeat(Rasterizer& rasterizer, const Rect& part) {
  const View view = straight_view();
  TileLayer<Key> layer(FrameLayout({view.screen}));
  std::vector<double> draw;
  std::vector<double> read;
  for (int i = 0; i <= kRepetitions; ++i) {
    layer.clear();
    rasterizer.draw(view, 0, std::array{part}, layer);
    if (i == 0) continue;  // compiles shaders and takes memory
    const RasterStats& stats = rasterizer.stats();
    draw.push_back(1e6 * (stats.cull_ms + stats.draw_ms));
    read.push_back(1e6 * (stats.read_ms + stats.pack_ms));
  }
  const double least = std::ranges::min(draw);
  return {least, std::ranges::min(read), least > 0.0 ? median_of(draw) / least : 1.0};
}

}  // namespace

RasterSpeed measure_raster_speed(GlContext& context) {
  constexpr std::uint32_t kSquares = 96;
  const Scene fine = grid_scene(kSquares);
  const Scene coarse = grid_scene(1);
  Rasterizer fine_rasterizer(context, fine, std::array{SurfaceRange{0, fine.triangles}}, 1);
  Rasterizer coarse_rasterizer(context, coarse, std::array{SurfaceRange{0, coarse.triangles}}, 1);
  const Repeated small = repeat(coarse_rasterizer, {0, 0, kTileSide, kTileSide});
  const Repeated filled = repeat(coarse_rasterizer, {0, 0, kSide, kSide});
  const Repeated drawn = repeat(fine_rasterizer, {0, 0, kSide, kSide});
  constexpr double kSmall = kTileSide * kTileSide;
  constexpr double kPixels = kSide * kSide;
  RasterSpeed speed;
  speed.pixel = std::max((filled.draw_ns - small.draw_ns) / (kPixels - kSmall), 1e-3);
  speed.read = std::max((filled.read_ns - small.read_ns) / (kPixels - kSmall), 1e-3);
  speed.triangle = std::max((drawn.draw_ns - filled.draw_ns) / fine.triangles, 1e-3);
  speed.draw = std::max(small.draw_ns + small.read_ns - kSmall * (speed.pixel + speed.read), 0.0);
  speed.spread = std::max(drawn.spread, filled.spread);
  return speed;
}

}  // namespace hpr
