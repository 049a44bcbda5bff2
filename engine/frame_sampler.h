#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/checkpoint/checkpoint_file.h"
#include "engine/film.h"
#include "engine/frame.h"
#include "engine/samples.h"
#include "engine/tile_ownership.h"

namespace hpr {

class Interrupt;
class Progress;
class Session;
struct CheckpointSettings;

/// Makes a frame: draws samples, each a frame seen through its own position in the pixels, until the goal is reached,
/// and takes their mean. A single sample through the pixels' centres is that frame itself, and nothing is summed.
class FrameSampler {
 public:
  /// `frame`: its number, by which its noise differs from other frames'. `keeps_keys`, and AOVs that need them:
  /// frame().keys are those of the first sample; else they are the last one's, and none where no sample was drawn.
  FrameSampler(Session& session, const FramePlan& plan, const Sampling& sampling, std::uint64_t frame, bool keeps_keys);

  /// Collective. views[i] is screen i of the plan's layout. Between samples all ranks exchange received signals (see
  /// Request) and rank 0's clock, which says when a checkpoint is due. False when it stopped before its goal: then a
  /// checkpoint was written. Throws Error as CheckpointFile does.
  [[nodiscard]] bool draw(std::span<const View> views, const CheckpointSettings& checkpoint, Progress& progress);

  /// After draw(), on rank 0, once what became of its frame is written: removes checkpoints nobody asked for.
  void remove_unasked_checkpoints();

  /// Collective. Draws one more sample unless the goal is reached; frame() is the means of those so far.
  /// False on all ranks where `interrupt` was raised on any before the sample was whole: then all is as it was before,
  /// and the same sample is the next one.
  [[nodiscard]] bool refine(std::span<const View> views, Interrupt* interrupt = nullptr);

  /// The means, after draw() returned true. Valid as long as this object.
  [[nodiscard]] Frame& frame() { return frame_; }
  /// Summed over the samples this run drew.
  [[nodiscard]] const FrameTimes& times() const { return times_; }
  [[nodiscard]] const SampleProgress& sample_progress() const { return progress_; }

 private:
  void load(const CheckpointSettings& checkpoint);
  void write(const CheckpointSettings& checkpoint, bool asked_for);
  /// Writes a checkpoint; false, with an error's lines, where it cannot.
  bool try_to_write(const CheckpointSettings& checkpoint, bool asked_for);
  /// Draws `count` samples together, at most size_of_round(). False where a single one was overtaken, and is not added.
  bool add_samples(std::span<const View> views, std::uint32_t count, Interrupt* interrupt = nullptr);
  /// How many samples to draw together.
  [[nodiscard]] std::uint32_t size_of_round();
  /// Once the first sample after a checkpoint was read has given tiles their owners: sends them the sums.
  void scatter();
  [[nodiscard]] JitteredViews jittered_views(std::span<const View> views, std::uint32_t number, double& weight);
  /// This rank's tiles.
  [[nodiscard]] std::vector<std::size_t> tiles() const;
  /// Before samples are drawn: which pixels they are for, in due_.
  void choose_pixels();
  /// Updates progress_ after samples were added; `seconds` in all.
  void report_progress(double seconds);
  void finish();
  /// Collective: makes known what the tiles took.
  [[nodiscard]] bool measures_costs() const;
  void note_costs();

  Session& session_;
  const FramePlan& plan_;
  Sampling sampling_;
  std::uint64_t number_;
  Film film_;
  std::optional<AdaptiveSampling> adaptive_;
  PixelMask due_;  ///< for the samples at hand; empty: all are
  bool keeps_keys_;
  std::uint32_t resumed_ = 0;  ///< samples that came from a checkpoint
  bool scattered_ = true;      ///< false: rank 0 alone has the sums of a checkpoint
  std::optional<TileOwnership> ownership_;
  std::optional<CheckpointFile> checkpoint_file_;
  SampleProgress progress_;
  Frame frame_;
  FrameTimes times_;
};

}  // namespace hpr
