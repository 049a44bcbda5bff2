#pragma once

#include <CLI/App.hpp>
#include <string>
#include <vector>

#include "app/frame.h"
#include "scene/view.h"

namespace hpr {

/// The flags of `render` that every command that draws a scene has.
struct RenderOptions {
  std::string camera;
  std::vector<double> eye;
  std::vector<double> at;
  std::vector<double> up{0.0, 1.0, 0.0};
  double fov_degrees = 0.0;
  std::string passes = "auto";
  int max_depth = 8;
  std::string distribute = "auto";
  int groups = 0;
  std::string strategy = "auto";
  std::string shading = "deferred";
  bool explain = false;
  std::string stats;
  double exposure = 0.0;  ///< stops, of display colours only

  void declare(CLI::App& app);

  /// The camera the user means: by --eye and --at, by name or index, else the scene's first, else one that frames it.
  [[nodiscard]] Camera choose_camera(const Scene& scene) const;

  /// Throws Error (Usage) for unknown names, before any scene is loaded.
  [[nodiscard]] FrameSettings settings() const;
};

}  // namespace hpr
