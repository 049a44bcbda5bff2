#include "app/command.h"

namespace hpr {

// Every command of the program, in the order `hpr help` lists them. Each stands in a file of its own, NAME_command.cpp,
// which defines make_NAME_command().
#define HPR_FOR_EACH_COMMAND(visit)                                                                              \
  visit(demo) visit(render) visit(wall) visit(console) visit(display) visit(view) visit(compare) visit(tradeoff) \
      visit(diff) visit(scene) visit(bench) visit(stability) visit(doctor)

#define HPR_DECLARE_COMMAND(name) std::unique_ptr<Command> make_##name##_command();
#define HPR_MAKE_COMMAND(name) all.push_back(make_##name##_command());

HPR_FOR_EACH_COMMAND(HPR_DECLARE_COMMAND)

std::vector<std::unique_ptr<Command>> all_commands() {
  std::vector<std::unique_ptr<Command>> all;
  HPR_FOR_EACH_COMMAND(HPR_MAKE_COMMAND)
  return all;
}

}  // namespace hpr
