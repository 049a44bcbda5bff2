#pragma once

#include <CLI/App.hpp>
#include <string>

#include "rt/ray_build.h"

namespace hpr {

/// How Embree's scenes are made, as the command line says it.
struct RayBuildOptions {
  std::string embree_quality = "medium";
  std::string deterministic = "on";

  void declare(CLI::App& app);
  /// Throws Error (Usage) with the choices.
  [[nodiscard]] RayBuild build() const;
};

}  // namespace hpr
