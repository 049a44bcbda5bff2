#include "tools/compare/compare_scene.h"

#include "engine/frame.h"
#include "engine/render_settings.h"
#include "engine/session.h"
#include "tools/report/lists.h"
#include "walls/config/wall_file.h"
#include "walls/geometry/geometry.h"

namespace hpr {
namespace {

/// Collective: this rank's share of a frame, drawn.
DrawnTiles draw_share(Communicator& comm, const std::string& scene, const Wall& wall, const Globals& globals,
                      const FrameSettings& settings) {
  Session session(comm, globals.session(), [&] { return load_scene(scene, globals.scene_limits()); });
  const std::vector<View> views =
      wall_views(wall, choose_camera(CameraChoice{}, session.scene()), session.scene().bounds);
  FramePlan plan = plan_frame(session, settings, views);
  plan.lit = false;
  TileLayer<Key> layer(plan.layout);
  (void)draw_layer(session, plan, views, layer);
  return {std::move(layer), plan.tiles};
}

}  // namespace

CompareInput scene_layers(const std::string& scene, Size screen, Size grid, bool local_shading,
                          const Globals& globals) {
  const Wall wall = load_wall(wall_of(grid, screen));
  CompareInput input;
  input.name = scene;
  input.screen = screen;
  input.grid = grid;
  input.colors = local_shading;
  FrameSettings settings = resolve(RenderSettings{}, globals.seed).frame;
  settings.shading = local_shading ? Shading::Local : Shading::Deferred;
  settings.distribution = Distribution::SortLast;
  input.layer = [=](Communicator& comm) { return draw_share(comm, scene, wall, globals, settings).layer; };
  settings.distribution = Distribution::SortFirst;
  input.sort_first = [=](Communicator& comm) { return draw_share(comm, scene, wall, globals, settings); };
  return input;
}

}  // namespace hpr
