#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/budget.h"
#include "engine/frame.h"
#include "engine/output.h"
#include "engine/samples.h"

namespace hpr {

class FrameSampler;
class Interrupt;
class Progress;
class Session;

/// Makes one frame after the other of the same screens, each seen from anywhere. With a target time it decides what
/// each is made with; while the eye is_resting it refines one picture instead, sample by sample, with nothing given up.
class FrameMaker {
 public:
  /// Collective. `screens`: as first seen; sizes stay. `target_ms` of a frame; none: all are made as the settings say.
  /// `resting`: what a picture is refined to while the eye is_resting; none: as `sampling`. `keeps_keys`: without a
  /// target, frames have the keys of their first sample.
  FrameMaker(Session& session, FrameSettings settings, const Sampling& sampling, std::span<const View> screens,
             std::optional<double> target_ms, const std::optional<SampleGoal>& resting = {}, bool keeps_keys = false);
  ~FrameMaker();
  FrameMaker(const FrameMaker&) = delete;
  FrameMaker& operator=(const FrameMaker&) = delete;

  /// Collective. Valid until the next one; made in blocks(). `progress` shows its samples. Null on all ranks where a
  /// picture was to be refined and `interrupt` was raised on any first: then there is no new frame, and the screens
  /// keep the last one.
  [[nodiscard]] Frame* make(std::span<const View> screens, std::uint64_t number, Progress& progress,
                            Interrupt* interrupt = nullptr);
  /// The last one.
  [[nodiscard]] Frame& frame();
  /// Collective. Records the time of the slowest rank for the last frame, equal on all ranks; the budget follows it.
  void record_frame_time(double slowest_ms);

  /// After a frame that failed: what was refined so far is not trusted, and made anew.
  void discard();

  /// Whether the same screens once more would give the last frame again: it was refined as far as it is to be.
  [[nodiscard]] bool refined(std::span<const View> screens) const;

  /// The plan of the last frame; before the first frame, of the first.
  [[nodiscard]] const FramePlan& plan() const { return plan_; }
  [[nodiscard]] const Blocks& blocks() const { return blocks_; }
  [[nodiscard]] const FrameTimes& times() const { return times_; }
  /// The part of times() that earlier frames of a refined picture took.
  [[nodiscard]] const FrameTimes& times_before() const { return times_before_; }
  /// What verifying the last frame found; of a refined picture, in the samples that this frame added.
  [[nodiscard]] VerifyCounts verified() const;
  [[nodiscard]] std::optional<double> relmse() const { return relmse_; }
  /// The degradations of the last frame; none without a target.
  [[nodiscard]] const std::optional<BudgetReport>& report() const { return report_; }

 private:
  void plan_for(const Effort& effort, std::span<const View> screens);
  void choose_distribution_again();
  void make_anew(std::uint64_t number, std::uint32_t samples, Progress& progress);
  [[nodiscard]] bool refine(std::span<const View> screens, std::uint64_t number, Interrupt* interrupt);
  void write_report(const Effort& effort, std::uint32_t samples);
  [[nodiscard]] bool is_resting(std::span<const View> screens) const;
  [[nodiscard]] std::uint32_t max_samples() const;
  [[nodiscard]] std::vector<std::string> all_degradations() const;

  Session& session_;
  FrameSettings settings_;  ///< with nothing given up
  Sampling sampling_;
  Sampling resting_;
  std::optional<double> target_ms_;
  bool keeps_keys_;
  std::vector<std::string> degradations_;
  std::optional<FrameBudget> budget_;
  Effort effort_;  ///< that plan_ is for
  Blocks blocks_;
  FramePlan plan_;
  int frames_of_plan_ = 0;        ///< since its distribution was last chosen
  bool light_was_known_ = false;  ///< when that was chosen
  std::vector<View> last_screens_;
  std::unique_ptr<FrameSampler> sampler_;  ///< of the frame at hand, or the picture that is refined
  bool refining_ = false;
  FrameTimes times_;
  FrameTimes times_before_;
  std::optional<double> relmse_;
  std::optional<BudgetReport> report_;
};

}  // namespace hpr
