#pragma once

#include <string>

namespace hpr {

/// Which of the scenes and variants that a file holds is loaded.
struct SceneChoice {
  std::string scene = {};    ///< its name or index; empty: the one that the file names, else the first
  std::string variant = {};  ///< of materials; empty: the materials that the file has without any

  bool operator==(const SceneChoice&) const = default;
};

}  // namespace hpr
