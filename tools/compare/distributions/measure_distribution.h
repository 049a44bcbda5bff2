#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "app/options/globals.h"
#include "cluster/transport/communicator.h"
#include "engine/render_settings.h"
#include "image/image.h"
#include "tools/compare/distributions/distribution_run.h"
#include "tools/sweep.h"

namespace hpr {

/// Whole frames that are compared, whoever draws them.
struct DistributionInput {
  std::string scene;
  RenderSettings settings;  ///< as given, not resolved, without a distribution
  Size screen;              ///< pixels of one screen
  Size grid{1, 1};          ///< screens of the wall
  std::uint64_t seed = 1;

  /// The settings of a frame of this distribution, resolved. Throws Error (Usage) where they exclude it.
  [[nodiscard]] RenderSettings settings_for(const std::string& distribution) const;
};

/// Called on rank 0 with each measured frame; returns how many of its pixels are wrong.
using CheckFrame = std::function<std::uint64_t(const WholeFrame&)>;

/// Collective. Draws the same frame again and again, as `hpr render` and `hpr wall run` do with these settings, and
/// measures it from its first triangle to its last tile on the screen it is shown on. The run stands on rank 0, but for
/// what is known of all ranks' memory alone. Ranks' peaks of memory are read before the first frame is checked.
[[nodiscard]] DistributionRun measure_distribution(Communicator& comm, const Globals& globals,
                                                   const DistributionInput& input, const std::string& distribution,
                                                   Repetitions frames, const CheckFrame& check);

}  // namespace hpr
