#pragma once

#include <span>
#include <string>
#include <vector>

#include "app/commands/wall_run.h"
#include "engine/wall/wall_driver.h"

namespace hpr {

/// Files of what a wall's last frame has beside its colours, per picture of screen_eyes(); empty where not wanted.
struct WallLayers {
  std::vector<std::string> aov;  ///< DIR/SCREEN.aov.exr; DIR/SCREEN-left.aov.exr and -right where a panel takes two
  std::vector<std::string> raw;  ///< FILE where there is one picture, else FILE-SCREEN, before the extension

  /// Throws Error (Usage) where `run` has no such files, or no frame with a value for every pixel.
  WallLayers(const WallRun& run, const Wall& wall, const FrameSettings& settings);
  [[nodiscard]] std::vector<std::string> all() const;
};

/// Collective, after the last frame. Rank 0 writes them; all throw Error (Io) where it cannot.
void write_layers(const WallLayers& files, std::span<const Aov> aovs, WallDriver& driver, Session& session);

}  // namespace hpr
