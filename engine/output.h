#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cluster/distribution/balance.h"
#include "core/error.h"
#include "core/parallel.h"
#include "engine/aov.h"
#include "engine/budget.h"
#include "engine/display/exposure.h"
#include "engine/frame.h"
#include "image/color.h"
#include "image/filter.h"
#include "image/image.h"
#include "image/tiles.h"
#include "image/tone.h"
#include "raster/raster_stats.h"
#include "rt/passes/pass_id.h"
#include "rt/ray_counts.h"
#include "scene/view.h"

namespace hpr {

class Session;
struct ExrLayer;
struct FramePlan;

/// Screens cut into the blocks that are rasterised at once; most screens are one block.
struct Blocks {
  std::vector<View> views;             ///< one per block: the screens of the frame's layout
  std::vector<std::size_t> screen_of;  ///< per block
  std::vector<PicturePart> made;       ///< per screen, of the picture that it is a part of
  std::vector<PicturePart> shown;      ///< per screen: the same where it is shown
};

/// `screens` may be blocks of larger ones (join_screens). `scale`: see at_resolution.
[[nodiscard]] Blocks cut_blocks(std::span<const View> screens, double scale = 1.0);

/// One screen's pixels, put together from its blocks. `threads`: for large pictures, most of whose time the system
/// spends on memory that is touched for the first time.
template <typename Pixel>
[[nodiscard]] Image<Pixel> join_blocks(const TileLayer<Pixel>& layer, const Blocks& blocks, std::size_t screen,
                                       int threads = 1) {
  const Rect& whole = blocks.made[screen].pixels;
  std::vector<std::size_t> tiles;
  for (std::size_t block = 0; block < blocks.views.size(); ++block) {
    if (blocks.screen_of[block] != screen) continue;
    const TileRun run = layer.layout().tiles_of(block);
    for (std::size_t tile = run.first; tile < run.end(); ++tile) tiles.push_back(tile);
  }
  Image<Pixel> image({whole.width(), whole.height()});
  parallel_for(threads, tiles.size(), [&](std::size_t i) {
    if (!layer.active(tiles[i])) return;
    const TilePlace location = layer.layout().place(tiles[i]);
    const Rect& block = blocks.views[location.screen].block;
    const auto width = static_cast<std::size_t>(location.pixels.width());
    const auto column = static_cast<std::size_t>(location.pixels.x0 + block.x0 - whole.x0);
    for (int y = 0; y < location.pixels.height(); ++y) {
      const auto from = layer.tile(tiles[i]).subspan(static_cast<std::size_t>(y) * kTileSide, width);
      std::ranges::copy(from, image.row(location.pixels.y0 + y + block.y0 - whole.y0).subspan(column, width).begin());
    }
  });
  return image;
}

/// What verifying a frame found, and how much of it was verified.
struct VerifyReport {
  double percent = 0.0;  ///< of the tiles
  VerifyCounts counts;
};

/// How evenly the ranks worked: of what they computed themselves, without waiting, the slowest rank by the mean.
struct BalanceReport {
  Balance balance = Balance::Demand;
  double keys = 1.0;
  double light = 1.0;
  double slowest_over_mean = 1.0;  ///< of both
  std::uint64_t lent = 0;          ///< pieces of tiles that others than their owners lit
};

/// Times and counts of a run of frames, as `--stats` writes it (schema hpr.stats/1) and `demo` prints it.
struct RunStats {
  double ms = 0.0;                     ///< one frame, all its samples, slowest rank
  int samples = 1;                     ///< drawn by this run
  int samples_in_all = 1;              ///< of the picture: with those of a checkpoint
  std::optional<double> relmse;        ///< of a frame of several samples, estimated from their halves
  std::optional<BudgetReport> budget;  ///< of a frame with a target time
  BalanceReport balance;
  std::optional<VerifyReport> verify;       ///< of a frame some of whose tiles were verified
  std::optional<DisplayTransform> display;  ///< of a frame that was shown
  std::vector<std::string> plan;
  std::vector<PassPlan> passes;
  std::vector<PassTime> times;                   ///< of each pass that ran: the slowest rank
  RayCounts rays;                                ///< summed over ranks
  RasterStats raster;                            ///< counts summed over ranks, times the slowest rank's
  std::size_t bytes_sent = 0;                    ///< by the frame, to the screens included; summed over ranks
  std::vector<std::uint64_t> memory_peak_bytes;  ///< per rank
  std::vector<std::uint64_t> page_loads;         ///< per rank, since the scene was loaded; empty: no part has pages
  int ranks = 1;
};

/// Time and traffic of one frame on this rank, from its first triangle to its last tile on a screen.
struct FrameCost {
  double ms = 0.0;
  std::size_t bytes_sent = 0;
};

/// Collective. Gathers the statistics of the session's last frame on every rank. Warns, on rank 0, of pixels without
/// finite radiance.
[[nodiscard]] RunStats gather_stats(Session& session, const FramePlan& plan, const FrameTimes& times,
                                    const FrameCost& cost);

/// The exit code of a finished run: a tile whose drawings all differ is a failed check, and `strict` makes pixels
/// without finite radiance one.
[[nodiscard]] inline ExitCode verdict(const RunStats& stats, bool strict) {
  const bool is_unmended = stats.verify && stats.verify->counts.unmended > 0;
  return is_unmended || (strict && stats.rays.not_finite > 0) ? ExitCode::CheckFailed : ExitCode::Done;
}

/// The views of `screens` with round(`scale` times) their pixels, at least one a side: for frames that are made smaller
/// than they are shown. Blocks of larger screens get the pixels that enlarging takes of their neighbors as well.
[[nodiscard]] std::vector<View> at_resolution(std::span<const View> screens, double scale);

/// Where a frame is shown.
struct Showing {
  std::vector<Size> sizes;    ///< per screen, pixels; a frame made of fewer or more is enlarged by a filter
  std::vector<int> shown_by;  ///< per screen the rank
  DisplayTransform transform;
  AlphaUse alpha = AlphaUse::OverBlack;
};

/// Collective. Brings the frame, which was made in `blocks`, to the ranks that show it. Per screen its display colours,
/// empty where another rank shows it.
[[nodiscard]] std::vector<Image<Rgba8>> bring_to_screens(Session& session, Frame& frame, const Blocks& blocks,
                                                         const Showing& showing);

/// What is wrong with a picture of which more than nine tenths are black or clipped (a channel at 255), and what to do:
/// one line; empty where nothing is. Pixels of alpha 0 count only where there are no others.
[[nodiscard]] std::string advice_on(const Image<Rgba8>& picture);

/// The files one picture may become; empty names are not written.
struct PictureFiles {
  std::string picture;      ///< .png or .exr
  std::string raw;          ///< keys
  DisplaySettings display;  ///< of a .png
  std::vector<Aov> aovs;
  ColorFormat colors = ColorFormat::Float32;  ///< as sent to the rank that writes an .exr

  [[nodiscard]] bool is_png() const { return picture.ends_with(".png"); }
  /// Whether the picture, or what its AOVs go into, is an .exr.
  [[nodiscard]] bool has_exr() const { return !picture.empty() && (!is_png() || !aovs.empty()); }
  /// Where AOVs go: into the .exr, or FILE.aov.exr beside a .png. Empty when there are none.
  [[nodiscard]] std::string aov_file() const;
  /// For --explain.
  [[nodiscard]] std::string explain_colors() const;
};

/// On the rank that has all of `frame`: the layers of the pixels of `screen`, the alpha of a transparent one first.
[[nodiscard]] std::vector<ExrLayer> exr_layers(const Frame& frame, const Blocks& blocks, std::size_t screen,
                                               std::span<const Aov> aovs);

/// A frame of one screen on its way to its files.
class CollectedPicture {
 public:
  /// Collective. Brings what the files need of `frame` to rank 0. `blocks` are the screen's; both must outlive this. A
  /// frame made of other than `size` pixels is enlarged by a filter; it has neither keys nor AOVs for files.
  CollectedPicture(Session& session, Frame& frame, const Blocks& blocks, Size size, PictureFiles files);

  /// On rank 0. Throws Error (Io).
  void write(const std::string& scene_name) const;
  /// On rank 0, for an .exr: what it will hold.
  [[nodiscard]] Image<Rgb> radiance() const;
  /// On all ranks, for a .png: how radiance became its colours.
  [[nodiscard]] const std::optional<DisplayTransform>& transform() const { return transform_; }

 private:
  void write_picture(const std::string& scene_name) const;
  /// Of a transparent picture: its alpha.
  [[nodiscard]] std::optional<Image<float>> alpha() const;
  void collect_radiance(Session& session, Frame& frame) const;
  [[nodiscard]] bool enlarged() const { return blocks_.views.front().screen != size_; }

  const Frame& frame_;
  const Blocks& blocks_;
  Size size_;
  int threads_;
  PictureFiles files_;
  std::optional<DisplayTransform> transform_;
  TileLayer<Rgba8> display_;  ///< where a .png is wanted
};

}  // namespace hpr
