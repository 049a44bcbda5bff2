#pragma once

#include <string>

#include "image/color_format.h"
#include "image/depth_format.h"
#include "rt/trace/ray_build.h"

namespace CLI {
class App;
}  // namespace CLI

namespace hpr {

/// How Embree's scenes are made, as the command line says it.
struct RayBuildOptions {
  std::string embree_quality = "medium";
  std::string deterministic = "on";

  void declare(CLI::App& app);
  /// Throws Error (Usage) with the choices.
  [[nodiscard]] RayBuild build() const;
};

/// What is sent between ranks, as the command line says it.
struct WireOptions {
  std::string depth_format = "32f";
  std::string color_format = "32f";

  void declare(CLI::App& app);
  /// Throws Error (Usage) with the choices.
  [[nodiscard]] DepthFormat depths() const;
  /// The same.
  [[nodiscard]] ColorFormat colors() const;
};

}  // namespace hpr
