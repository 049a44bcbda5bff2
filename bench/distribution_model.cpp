#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <string>
#include <vector>

#include "cluster/transport/local_communicator.h"
#include "core/timing.h"
#include "engine/balance/frame_model.h"
#include "engine/balance/view_grouping.h"
#include "engine/session.h"
#include "scene/load_scene.h"
#include "scene/view.h"

// What the model of frames expects of each distribution on ever more ranks, from six sides of a scene: time,
// efficiency, overlap and what limits. Stage costs are measured here (OpenGL) or as docs/distribution.md has them; the
// link is 10 Gbit/s of each rank. Arguments: SCENE [WIDTHxHEIGHT].
namespace hpr {
namespace {

std::vector<View> six_views(const Scene& scene, Size size) {
  const glm::dvec3 center = 0.5 * (scene.bounds.low + scene.bounds.high);
  const double extent = glm::length(scene.bounds.high - scene.bounds.low);
  std::vector<View> views;
  for (int side = 0; side < 6; ++side) {
    const double angle = glm::two_pi<double>() * side / 6.0;
    const glm::dvec3 direction(std::cos(angle), 0.25 + 0.1 * side, std::sin(angle));
    const Camera camera = look_at(center + 0.75 * extent * glm::normalize(direction), center, {0.0, 1.0, 0.0}, 0.8);
    views.push_back(make_view(camera, size, scene.bounds));
  }
  return views;
}

void run(const std::string& scene, Size size) {
  run_local_ranks(1, [&](Communicator& comm) {
    Session session(comm, {.threads = 1}, [&] { return load_scene(scene); });
    MachineSpeeds speeds;
    const std::unique_ptr<GlContext> context = make_gl_context({});
    speeds.raster = measure_raster_speed(*context);
    fmt::print("{}: {} triangles, {}x{}; triangle {:.0f} ns, pixel {:.1f} ns, read {:.1f} ns, draw {:.0f} ns\n", scene,
               session.scene().triangles, size.width, size.height, speeds.raster.triangle, speeds.raster.pixel,
               speeds.raster.read, speeds.raster.draw);
    fmt::print("{:>5} {:<10} {:>8} {:>8} {:>9} {:>8} {:>8} {:>8} {:>9} {:>10}\n", "ranks", "", "ms", "draw",
               "composite", "light", "prepare", "overlap", "imbalance", "efficiency");
    std::vector<FrameLoad> loads;
    const std::vector<View> views = six_views(session.scene(), size);
    for (const View& view : views) loads.push_back(load_of(session, std::span(&view, 1)));
    for (const int ranks : {8, 64, 1024}) {
      const Stopwatch watch;
      (void)group_by_view(loads.front().layout, loads.front().chunks, ranks, speeds.draw_speeds());
      const double group_ms = watch.ms();
      const Stopwatch again;
      (void)chunks_on_screens(session, std::span(&views.front(), 1));
      const double bound_ms = again.ms();
      const ViewGroups groups = group_by_view(loads.front().layout, loads.front().chunks, ranks, speeds.draw_speeds());
      View moved = views.front();
      moved.left += 0.01;
      moved.right += 0.01;
      const std::vector<ScreenChunk> chunks = chunks_on_screens(session, std::span(&moved, 1));
      const Stopwatch third;
      (void)follow_view(groups, loads.front().chunks, loads.front().layout, chunks, speeds.draw_speeds());
      fmt::print("{} chunks: bounded in {:.2f} ms, grouped for {} ranks in {:.2f} ms, for a view beside it in {:.2f}\n",
                 loads.front().chunks.size(), bound_ms, ranks, group_ms, third.ms());
    }
    for (const int ranks : {1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024}) {
      for (const Distribution distribution : kDistributions) {
        FramePrediction mean{};
        mean.imbalance = 0.0;
        mean.overlap = 0.0;
        double efficient = 0.0;
        for (const FrameLoad& load : loads) {
          const FramePrediction one = predict_frame(Distribution::SortFirst, load, speeds, 1);
          const FramePrediction made = predict_frame(distribution, load, speeds, ranks);
          const double part = 1.0 / static_cast<double>(loads.size());
          efficient += part * efficiency(one, made, ranks);
          mean.draw_ms += part * made.draw_ms;
          mean.composite_ms += part * made.composite_ms;
          mean.light_ms += part * made.light_ms;
          mean.prepare_ms += part * made.prepare_ms;
          mean.imbalance += part * made.imbalance;
          mean.overlap += part * made.overlap;
        }
        fmt::print("{:>5} {:<10} {:>8.2f} {:>8.2f} {:>9.2f} {:>8.2f} {:>8.2f} {:>8.2f} {:>9.2f} {:>8.1f} %\n", ranks,
                   name_of(distribution), mean.total_ms(), mean.draw_ms, mean.composite_ms, mean.light_ms,
                   mean.prepare_ms, mean.overlap, mean.imbalance, 100.0 * efficient);
      }
    }
  });
}

}  // namespace
}  // namespace hpr

int main(int argc, char** argv) {
  const std::string scene = argc > 1 ? argv[1] : "gen:sphereflake?s=5&n=4";
  hpr::Size size{1920, 1080};
  if (argc > 2 && std::sscanf(argv[2], "%dx%d", &size.width, &size.height) != 2) return EXIT_FAILURE;
  hpr::run(scene, size);
  return EXIT_SUCCESS;
}
