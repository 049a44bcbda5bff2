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

/// Collective, in one round of messages, where the scene is partitioned. Culls all chunks of `rasterizer`, this rank's
/// part, and sends the triangles of those that are found to the owners of the areas; returns the rasterizer that holds
/// those that all found for this rank's area. Valid until the next call.
[[nodiscard]] Rasterizer& receive_triangles(Session& session, const FramePlan& plan, const Rasterizer& rasterizer,
                                            std::span<const View> views, FrameTimes& spent);

/// Of sort-middle: who culls what.
[[nodiscard]] std::string explain_binning(const FramePlan& plan, int ranks);

}  // namespace hpr
