#include "app/bench_command.h"
#include "app/command.h"
#include "app/compare_command.h"
#include "app/compare_scene.h"
#include "app/demo_command.h"
#include "app/render_command.h"

namespace hpr {

std::vector<std::unique_ptr<Command>> all_commands() {
  std::vector<std::unique_ptr<Command>> all;
  all.push_back(make_demo_command());
  all.push_back(make_render_command());
  all.push_back(make_compare_command(scene_layers));
  all.push_back(make_bench_command());
  return all;
}

}  // namespace hpr
