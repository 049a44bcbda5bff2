#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "cluster/distribution/assignment.h"
#include "engine/aov.h"
#include "engine/frame_settings.h"
#include "image/tiles.h"
#include "rt/ray_settings.h"

namespace hpr {

class Session;
struct View;

/// Who does what in a frame; computed alike on every rank.
struct FramePlan {
  Distribution distribution = Distribution::SortFirst;
  int groups = 1;
  std::string strategy;
  Primary primary = Primary::Raster;  ///< never Auto
  DepthFormat depth_format = DepthFormat::Float32;
  Shading shading = Shading::Deferred;
  RaySettings rays;
  std::vector<Aov> aovs;
  double verify_percent = 0.0;  ///< of the tiles; see engine/verification.h
  bool lit = true;              ///< false: only the keys are wanted, no light is spent on them
  FrameLayout layout;
  Assignment mine;                     ///< this rank's part
  std::vector<std::size_t> tiles;      ///< of this rank's group, ascending
  std::vector<std::string> explained;  ///< one line per decision, with its reason
};

/// Collective, as it may measure (`Primary::Auto`).
[[nodiscard]] FramePlan plan_frame(Session& session, const FrameSettings& settings, std::span<const View> views);

/// From so much of open sky on rays bring indirect light: with less noise than photons in the same time where spheres
/// hang in the open, and with more in a room with a hole (docs/decisions/0009-even-skies-are-gathered.md).
inline constexpr double kOpenSky = 0.5;

}  // namespace hpr
