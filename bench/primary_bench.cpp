#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <ctime>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "raster/gl_context.h"
#include "raster/rasterizer.h"
#include "rt/trace/primary_rays.h"
#include "rt/trace/ray_scene.h"
#include "scene/load_scene.h"

// What keys cost by OpenGL and by rays: scenes of few to many triangles, at four sizes, in processor time of all
// threads, so that other work on the machine counts little. choose_primary() in engine/plan.h is the rule that follows
// from it. Arguments: scenes in place of the built-in ones.
namespace hpr {
namespace {

constexpr int kThreads = 2;
constexpr int kDraws = 5;
constexpr std::array<Size, 4> kSizes{{{64, 64}, {320, 180}, {1280, 720}, {3840, 2160}}};

double processor_ms() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

double cost_ms(const std::function<void()>& work) {
  const double begin = processor_ms();
  work();
  return processor_ms() - begin;
}

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

void measure(const std::string& source, GlContext& context) {
  const Scene scene = load_scene(source, {});
  const Camera camera = scene.cameras.empty() ? framing_camera(scene) : scene.cameras.front();
  std::unique_ptr<Rasterizer> rasterizer;
  std::unique_ptr<RayScene> rays;
  const double upload_ms = cost_ms([&] {
    rasterizer = std::make_unique<Rasterizer>(context, scene, std::array{SurfaceRange{0, scene.triangles}}, kThreads);
  });
  const double build_ms = cost_ms([&] { rays = std::make_unique<RayScene>(scene, RaySpace(scene), kThreads); });
  PrimaryRays primary(scene, *rays, kThreads);
  std::size_t own = 0;
  for (const Mesh& mesh : scene.meshes) own += mesh.triangles.size();
  fmt::print("{}: {} triangles of meshes with {}; upload {:.1f} ms, Embree's scene {:.1f} ms\n", source,
             scene.triangles, own, upload_ms, build_ms);
  for (const Size& size : kSizes) {
    const View view = make_view(camera, size, scene.bounds);
    const std::array all{view.block};
    TileLayer<Key> layer(FrameLayout({size}));
    rasterizer->draw(view, 0, all, layer);  // shaders and buffers of this size are made
    std::vector<double> by_raster;
    std::vector<double> by_rays;
    for (int i = 0; i < kDraws; ++i) {
      layer.clear();
      by_raster.push_back(cost_ms([&] { rasterizer->draw(view, 0, all, layer); }));
      layer.clear();
      by_rays.push_back(cost_ms([&] { primary.draw(view, 0, all, layer); }));
    }
    fmt::print("| {} | {} | {}x{} | {:.2f} | {:.2f} |\n", source, scene.triangles, size.width, size.height,
               median(by_raster), median(by_rays));
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace hpr

int main(int argc, char** argv) {
  std::vector<std::string> scenes(argv + 1, argv + argc);
  if (scenes.empty()) {
    scenes = {"gen:cornell",
              "gen:tetra?s=5",
              "gen:gallery",
              "gen:sphereflake?s=1",
              "gen:sphereflake?s=2",
              "gen:sphereflake?s=3",
              "gen:asteroids?k=3&count=78",
              "gen:asteroids?k=4&count=195",
              "gen:sphereflake?s=4",
              "gen:asteroids?k=5&count=488"};
  }
  std::unique_ptr<hpr::GlContext> context;
  const double start_ms = hpr::cost_ms([&] {
    context = hpr::make_gl_context({.backend = "auto", .device = -1, .local_rank = 0, .threads = hpr::kThreads});
  });
  fmt::print("{}: started in {:.1f} ms\n| scene | triangles | size | raster ms | rays ms |\n|---|---|---|---|---|\n",
             context->description(), start_ms);
  for (const std::string& scene : scenes) hpr::measure(scene, *context);
}
