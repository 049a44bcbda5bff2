#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "cluster/transport/collectives.h"
#include "cluster/transport/local_communicator.h"
#include "core/progress.h"
#include "engine/balance/load_balance.h"
#include "engine/frame_maker.h"
#include "engine/render_settings.h"
#include "engine/session.h"
#include "engine/settings_table.h"
#include "scene/load_scene.h"
#include "scene/view.h"

// How evenly ranks work under each --balance: frame after frame of some scenes that are hard to share out, by ranks
// that are threads of this process. What a rank works is the processor time of its keys and its light, so that other
// programs on the machine hardly count; the speed-up is all ranks' work by the slowest one's. Arguments: scenes that
// are to be drawn off the picture's centre by 2 ranks, in place of gen:sphereflake.
namespace hpr {
namespace {

constexpr int kFrames = 4;

struct Case {
  std::string name;
  std::string scene;
  int ranks = 2;
  std::vector<View> (*views)(const Scene& scene) = nullptr;
  std::vector<std::pair<std::string, std::string>> settings;
};

/// All there is stands in the left half.
std::vector<View> off_center(const Scene& scene) {
  Camera camera = choose_camera({}, scene);
  const glm::dvec3 center = 0.5 * (scene.bounds.low + scene.bounds.high);
  const double distance = glm::length(center - camera.eye);
  camera.eye += 0.42 * distance * camera.axes[0];
  return {make_view(camera, {1280, 720}, scene.bounds)};
}

/// All there is spans so many pixels, about the middle of a tile.
std::vector<View> spanning(const Scene& scene, double pixels) {
  Camera camera = choose_camera({}, scene);
  const glm::dvec3 center = 0.5 * (scene.bounds.low + scene.bounds.high);
  constexpr Size kSize{640, 480};
  const View there = make_view(camera, kSize, scene.bounds);
  const double pixel = (there.top - there.bottom) / kSize.height;  // its side, at a distance of one metre
  const double distance = glm::length(scene.bounds.high - scene.bounds.low) / (pixel * pixels);
  camera.eye = center + distance * (camera.axes[2] + 32.0 * pixel * camera.axes[0] - 16.0 * pixel * camera.axes[1]);
  return {make_view(camera, kSize, scene.bounds)};
}

/// So far away that all there is lies in one tile.
std::vector<View> one_tile(const Scene& scene) {
  return spanning(scene, 60.0);
}

/// What is costly in the middle lies in one tile.
std::vector<View> costly_tile(const Scene& scene) {
  return spanning(scene, 300.0);
}

std::vector<View> centered(const Scene& scene) {
  return {make_view(choose_camera({}, scene), {640, 480}, scene.bounds)};
}

/// Three by two screens that one camera sees.
std::vector<View> wall(const Scene& scene) {
  const View whole = make_view(choose_camera({}, scene), {3 * 320, 2 * 192}, scene.bounds);
  std::vector<View> screens;
  for (int row = 0; row < 2; ++row) {
    for (int column = 0; column < 3; ++column) {
      View screen = whole;
      screen.block = {320 * column, 192 * row, 320 * (column + 1), 192 * (row + 1)};
      screens.push_back(screen);
    }
  }
  return screens;
}

struct Row {
  std::vector<double> work_ms;  ///< per rank
  std::uint64_t lent = 0;
  double dearest = 0.0;  ///< tile, by the mean of all
};

/// The frames of a case.
std::vector<Row> draw(const Case& one, std::string_view balance) {
  std::vector<Row> rows;
  run_local_ranks(one.ranks, [&](Communicator& comm) {
    RenderSettings settings;
    for (const auto& [name, value] : one.settings) set_setting(settings, name, value);
    set_setting(settings, "balance", std::string(balance));
    settings = resolve(settings, 1);
    Session session(comm, {.threads = 1},
                    [&] { return load_scene(one.scene, settings, {}, {}, first_view(settings)); });
    const std::vector<View> views = one.views(session.scene());
    FrameMaker maker(session, settings.frame, settings.sampling, views, std::nullopt);
    prepare(session, maker.plan());
    for (int number = 0; number < kFrames; ++number) {
      Progress progress("none", "sample", 0);
      (void)maker.make(views, static_cast<std::uint64_t>(number), progress);
      Row row;
      const auto costs = session.balance().costs(maker.plan().layout);
      row.dearest = costs.empty() ? 0.0 : slowest_over_mean(costs);
      for (const FrameWork& work : all_gather_value(comm, maker.times().work)) {
        row.work_ms.push_back(work.keys_ms + work.light_ms);
        row.lent += work.lent;
      }
      if (comm.rank() == 0) rows.push_back(row);
    }
  });
  return rows;
}

void measure(const Case& one) {
  fmt::print(
      "\n{}: {}, {} ranks\n\n| balance | frame | slowest / mean | speed-up | lent | dearest tile / mean | work of each "
      "rank, ms |\n"
      "|---|---|---|---|---|---|---|\n",
      one.name, one.scene, one.ranks);
  for (const std::string_view balance : {"static", "measured", "demand"}) {
    int number = 0;
    for (const Row& row : draw(one, balance)) {
      const double ratio = slowest_over_mean(row.work_ms);
      std::string each;
      for (const double ms : row.work_ms) each += fmt::format("{}{:.0f}", each.empty() ? "" : " ", ms);
      fmt::print("| {} | {} | {:.3f} | {:.2f} | {} | {:.1f} | {} |\n", balance, number++, ratio, one.ranks / ratio,
                 row.lent, row.dearest, each);
    }
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace hpr

int main(int argc, char** argv) {
  using namespace hpr;
  const std::vector<std::pair<std::string, std::string>> rays{{"primary", "rays"}, {"passes", "shadow,reflection"}};
  std::vector<std::pair<std::string, std::string>> many = rays;
  many.emplace_back("environment", "studio");
  many.emplace_back("light-samples", "64");
  std::vector<std::string> scenes(argv + 1, argv + argc);
  if (scenes.empty()) scenes = {"gen:sphereflake?s=3"};
  for (const std::string& scene : scenes) measure({"off centre", scene, 2, off_center, rays});
  measure({"one tile has all triangles", "gen:sphereflake?s=2", 2, one_tile, many});
  measure({"one tile has all triangles", "gen:sphereflake?s=2", 4, one_tile, many});
  measure({"one tile has most rays", "gen:sphereflake?s=3", 2, costly_tile, many});
  measure({"one tile has most rays", "gen:sphereflake?s=3", 4, costly_tile, many});
  measure({"mirrors among plain walls", "gen:gallery", 4, centered, rays});
  measure({"a wall of 3x2 screens", "gen:gallery", 4, wall, rays});
  return EXIT_SUCCESS;
}
