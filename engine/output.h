#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/frame.h"
#include "engine/frame_budget.h"
#include "image/image.h"

namespace hpr {

/// Screens cut into the blocks that are rasterised at once; most screens are one block.
struct Blocks {
  std::vector<View> views;             ///< one per block: the screens of the frame's layout
  std::vector<std::size_t> screen_of;  ///< per block
};

[[nodiscard]] Blocks cut_blocks(std::span<const View> screens);

/// Per block the rank that shows its screen.
[[nodiscard]] std::vector<int> block_owners(const Blocks& blocks, std::span<const int> shown_by);

/// One screen's pixels, put together from its blocks.
template <typename Pixel>
[[nodiscard]] Image<Pixel> join_blocks(const TileLayer<Pixel>& layer, const Blocks& blocks, std::size_t screen) {
  Image<Pixel> image;
  for (std::size_t block = 0; block < blocks.views.size(); ++block) {
    if (blocks.screen_of[block] != screen) continue;
    const View& view = blocks.views[block];
    if (view.size() == view.screen) return to_image(layer, block);
    if (image.size() != view.screen) image = Image<Pixel>(view.screen);
    paste(to_image(layer, block), view.block.x0, view.block.y0, image);
  }
  return image;
}

/// A frame's tiles as display colours,
/// `exposure_stops` brighter.
[[nodiscard]] TileLayer<Rgba8> to_display(const Frame& frame, int threads, double exposure_stops);
/// The same of a picture.
[[nodiscard]] Image<Rgba8> to_display(const Image<Rgb>& radiance, int threads, double exposure_stops);

/// What a run of frames took, as `--stats` writes it (schema hpr.stats/1) and `demo` prints it.
struct RunStats {
  double ms = 0.0;                     ///< one frame, all its samples, slowest rank
  int samples = 1;                     ///< drawn by this run
  int samples_in_all = 1;              ///< of the picture: with those of a checkpoint
  std::optional<double> relmse;        ///< of a frame of several samples, as their halves tell it
  std::optional<BudgetReport> budget;  ///< of a frame with a target time
  std::vector<std::string> plan;
  std::vector<PassPlan> passes;
  std::vector<PassTime> times;                   ///< of each pass that ran: the slowest rank
  RayCounts rays;                                ///< summed over ranks
  std::size_t bytes_sent = 0;                    ///< by the frame, on its way to the screens too; summed over ranks
  std::vector<std::uint64_t> memory_peak_bytes;  ///< per rank
  int ranks = 1;
};

/// One frame on this rank, from its first triangle to its last tile on a screen.
struct FrameCost {
  double ms = 0.0;
  std::size_t bytes_sent = 0;
};

/// Collective. What the session's last frame took, on every rank. Warns, on rank 0, of pixels without finite radiance.
[[nodiscard]] RunStats gather_stats(Session& session, const FramePlan& plan, const FrameTimes& times,
                                    const FrameCost& cost);

/// What a run that is done leaves with: `strict` makes pixels without finite radiance a failed check.
[[nodiscard]] inline ExitCode verdict(const RunStats& stats, bool strict) {
  return strict && stats.rays.not_finite > 0 ? ExitCode::CheckFailed : ExitCode::Done;
}

}  // namespace hpr
