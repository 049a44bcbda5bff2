#pragma once

#include <span>
#include <string>

#include "cluster/distribution/chunk_exchange.h"

namespace hpr {

class Rasterizer;
class Session;
struct FramePlan;
struct FrameTimes;
struct View;

/// Whether ranks cull for each other in frames of this plan: under sort-middle.
[[nodiscard]] bool bins_chunks(const Session& session, const FramePlan& plan);

/// Collective, in one round of messages. Culls this rank's part of the scene for the areas of all ranks; returns per
/// screen what all found for this rank's area. `rasterizer`: the plan's, which holds the same chunks on all ranks.
/// views[i] is screen i of the plan's layout. Adds to `spent` what it counts.
[[nodiscard]] ScreenChunks find_chunks(Session& session, const FramePlan& plan, const Rasterizer& rasterizer,
                                       std::span<const View> views, FrameTimes& spent);

/// Of sort-middle: who culls what.
[[nodiscard]] std::string explain_binning(const FramePlan& plan, int ranks);

}  // namespace hpr
