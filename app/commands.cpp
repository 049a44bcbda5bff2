#include "app/bench_command.h"
#include "app/command.h"
#include "app/compare_command.h"
#include "app/compare_scene.h"
#include "app/console/console_command.h"
#include "app/demo_command.h"
#include "app/diff_command.h"
#include "app/display_command.h"
#include "app/doctor_command.h"
#include "app/graphics_checks.h"
#include "app/render_command.h"
#include "app/scene_command.h"
#include "app/stability_command.h"
#include "app/tradeoff_command.h"
#include "app/view_command.h"
#include "app/wall_command.h"

namespace hpr {

std::vector<std::unique_ptr<Command>> all_commands() {
  std::vector<std::unique_ptr<Command>> all;
  all.push_back(make_demo_command());
  all.push_back(make_render_command());
  all.push_back(make_wall_command());
  all.push_back(make_console_command());
  all.push_back(make_display_command());
  all.push_back(make_view_command());
  all.push_back(make_compare_command(scene_layers));
  all.push_back(make_tradeoff_command());
  all.push_back(make_diff_command());
  all.push_back(make_scene_command());
  all.push_back(make_bench_command());
  all.push_back(make_stability_command());
  all.push_back(make_doctor_command(graphics_checks()));
  return all;
}

}  // namespace hpr
