#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/frame_settings.h"
#include "image/color.h"
#include "image/image.h"
#include "image/key.h"
#include "tools/report/table.h"
#include "tools/sweep.h"

/// What `hpr compare --distribute` measures: whole frames of one distribution on one number of ranks.
namespace hpr {

/// The name that leaves the choice of a distribution to the plan, beside those of kDistributions.
inline constexpr const char* kAutoDistribution = "auto";
/// In place of a strategy's name where no layers are composited.
inline constexpr const char* kNoStrategy = "none";

/// What a peak of memory is the peak of.
inline constexpr const char* kMemoryOfRank = "rank";        ///< a process that drew nothing else
inline constexpr const char* kMemoryOfProcess = "process";  ///< whose threads are all of the ranks
inline constexpr const char* kMemoryOfJob = "job";          ///< a process that drew other distributions before

/// What one rank spent on a frame, with its waiting for others.
struct RankStages {
  double chunks_ms = 0.0;     ///< finding out what to draw
  double draw_ms = 0.0;       ///< keys
  double composite_ms = 0.0;  ///< merging layers of keys
  double move_ms = 0.0;       ///< keys to the owners of tiles
  double light_ms = 0.0;      ///< photons, and surfaces with their light
  double return_ms = 0.0;     ///< lent light back
  double collect_ms = 0.0;    ///< tiles to screens
};

/// The time of a frame by what it was spent on.
struct FrameStages {
  double draw_ms = 0.0;       ///< keys
  double composite_ms = 0.0;  ///< merging layers of keys
  double light_ms = 0.0;      ///< photons, and surfaces with their light
  double exchange_ms = 0.0;   ///< all else that moves
  double collect_ms = 0.0;    ///< the part of exchange_ms that brings tiles to screens
};

/// What one rank measured in one frame.
struct RankFrame {
  double ms = 0.0;  ///< from the frame's first triangle to the last tile on a screen of this rank's
  RankStages stages;
  double work_ms = 0.0;  ///< what it computed itself on all of its threads, without waiting
  std::uint64_t bytes = 0;
  std::uint64_t messages = 0;
};

/// A frame's stages as all ranks together passed them: each lasts from when the last rank was done with the stages
/// before it to when the last rank was done with it. So waiting counts as what was waited for, and the stages add up to
/// no more than the frame. Where a frame has several samples, in each of which ranks meet, times are sums over samples,
/// and what one rank waits for in one sample and another in the next counts as the stage they wait in. `shading`:
/// whether light comes before or after compositing.
[[nodiscard]] FrameStages stages_of(std::span<const RankFrame> ranks, Shading shading);

/// Frames of one distribution on one number of ranks; lists have one entry a frame, but for the one of ranks.
struct DistributionRun {
  std::string distribution;
  std::string
      chosen;  ///< the distribution at work, where `distribution` leaves the choice; of jobs that chose otherwise all
  std::string strategy = kNoStrategy;  ///< at work
  int ranks = 1;
  int threads = 1;  ///< of each rank
  std::string transport;
  std::vector<double> ms;  ///< slowest rank
  std::vector<double> draw_ms;
  std::vector<double> exchange_ms;
  std::vector<double> composite_ms;
  std::vector<double> light_ms;
  std::vector<double> collect_ms;
  std::vector<double> imbalance;  ///< of what ranks computed: slowest rank / mean
  std::vector<std::uint64_t> bytes_total;
  std::vector<std::uint64_t> bytes_max_rank;
  std::vector<std::uint64_t> messages_total;
  std::vector<std::uint64_t> memory_peak_bytes;  ///< per rank
  std::string memory_of = kMemoryOfRank;
  std::uint64_t differing_pixels = 0;  ///< of the worst frame: another key or another color than the reference's
  std::string frame_xxh64;             ///< as CompareRun::frame_xxh64
  std::string picture_xxh64;           ///< of the picture's RGBA8 pixels
  std::optional<double> predicted_ms;  ///< of `ms`

  void add(std::span<const RankFrame> frame, Shading shading = Shading::Deferred);
  /// Appends the frames of another job of the same distribution and ranks.
  void append(const DistributionRun& more);
};

/// The columns of runs as a job hands them over to the process that started it.
[[nodiscard]] const std::vector<Column<DistributionRun>>& distribution_job_columns();

/// A frame as it is compared with others: all screens of the wall, each in its place.
struct WholeFrame {
  Image<Key> keys;
  Image<Rgba8> picture;
};

/// How many pixels have another key or another color; where keys are not the picture's pixels, the more of both.
[[nodiscard]] std::uint64_t count_differing(const WholeFrame& a, const WholeFrame& b);

/// Writes a frame into a file that is there, for the other jobs of a comparison to read. Throws Error (Io).
void write_frame(const std::filesystem::path& file, const WholeFrame& frame);
[[nodiscard]] WholeFrame read_frame(const std::filesystem::path& file);

/// What the process that compares distributions asks of a job.
struct DistributionJob {
  std::string distribution;
  int ranks = 1;
  Repetitions frames;
  bool is_quiet = false;         ///< what a job before has warned of already is not repeated
  bool is_last = false;          ///< it writes the files that have the frame, and the trace
  bool makes_reference = false;  ///< it writes `reference`, which the others compare their frames with
  std::string reference;

  [[nodiscard]] std::string text() const;
  /// What this job was asked for; none in other processes. Throws Error (Internal) for what is no request.
  [[nodiscard]] static std::optional<DistributionJob> of_this_process();
  static constexpr const char* kVariable = "OMPI_HPR_COMPARE_DISTRIBUTION";
};

}  // namespace hpr
