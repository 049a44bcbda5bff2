#include "app/compare_scene.h"

#include <fmt/format.h>

#include "app/frame.h"
#include "app/render_options.h"
#include "walls/geometry.h"
#include "walls/wall_file.h"

namespace hpr {
namespace {

/// Collective: this rank's share of a frame, drawn.
DrawnTiles draw_share(Communicator& comm, const std::string& scene, const Wall& wall, const Globals& globals,
                      Distribution distribution) {
  Session session(comm, globals, [&] { return load_scene(scene, globals.scene_limits()); });
  const std::vector<View> views =
      wall_views(wall, RenderOptions{}.choose_camera(session.scene()), session.scene().bounds);
  FrameSettings settings;
  settings.distribution = distribution;
  const FramePlan plan = plan_frame(session, settings, views);
  TileLayer<Key> layer(plan.layout);
  rasterize(session, plan, views, layer);
  return {std::move(layer), plan.tiles};
}

}  // namespace

CompareInput scene_layers(const std::string& scene, Size screen, Size grid, const Globals& globals) {
  const Wall wall = load_wall(fmt::format("{}x{}@{}x{}", grid.width, grid.height, screen.width, screen.height));
  CompareInput input;
  input.name = scene;
  input.screen = screen;
  input.grid = grid;
  input.colors = false;
  input.layer = [=](Communicator& comm) {
    return draw_share(comm, scene, wall, globals, Distribution::SortLast).layer;
  };
  input.sort_first = [=](Communicator& comm) {
    return draw_share(comm, scene, wall, globals, Distribution::SortFirst);
  };
  return input;
}

}  // namespace hpr
