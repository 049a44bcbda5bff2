#include "walls/config/example_walls.h"

#include <filesystem>

namespace hpr::test {

std::string example_wall(const std::string& name) {
  return std::filesystem::path(HPR_WALL_EXAMPLES) / name;
}

}  // namespace hpr::test
