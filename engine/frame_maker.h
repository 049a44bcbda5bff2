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
class Progress;
class Session;

/// Makes one frame after the other of the same screens, each seen from anywhere. With a target time it decides what
/// each is made with; while the eye rests it refines one picture instead, sample by sample, with nothing given up.
class FrameMaker {
 public:
  /// Collective. `screens`: as first seen; sizes stay. `target_ms` of a frame; none: all are made as the settings say.
  /// `resting`: what a picture is refined to while the eye rests; none: as `sampling`. `keeps_keys`: without a target,
  /// frames have the keys of their first sample.
  FrameMaker(Session& session, FrameSettings settings, const Sampling& sampling, std::span<const View> screens,
             std::optional<double> target_ms, const std::optional<SampleGoal>& resting = {}, bool keeps_keys = false);
  ~FrameMaker();
  FrameMaker(const FrameMaker&) = delete;
  FrameMaker& operator=(const FrameMaker&) = delete;

  /// Collective. Valid until the next one; made in blocks(). `progress` is told of samples.
  [[nodiscard]] Frame& make(std::span<const View> screens, std::uint64_t number, Progress& progress);
  /// The last one.
  [[nodiscard]] Frame& frame();
  /// Collective. What the slowest rank took for the last frame, the same on all ranks.
  void took(double slowest_ms);

  /// Whether the same screens once more would give the last frame again: it was refined as far as it is to be.
  [[nodiscard]] bool refined(std::span<const View> screens) const;

  /// Of the last frame; before the first one, of that.
  [[nodiscard]] const FramePlan& plan() const { return plan_; }
  [[nodiscard]] const Blocks& blocks() const { return blocks_; }
  [[nodiscard]] const FrameTimes& times() const { return times_; }
  /// What of times() earlier frames took: those of the picture that is refined.
  [[nodiscard]] const FrameTimes& times_before() const { return times_before_; }
  [[nodiscard]] std::optional<double> relmse() const { return relmse_; }
  /// What of the last frame was given up; none without a target.
  [[nodiscard]] const std::optional<BudgetReport>& report() const { return report_; }

 private:
  void plan_for(const Effort& effort, std::span<const View> screens);
  void make_anew(std::uint64_t number, std::uint32_t samples, Progress& progress);
  void refine(std::span<const View> screens, std::uint64_t number, Progress& progress);
  void write_report(const Effort& effort, std::uint32_t samples);
  [[nodiscard]] bool rests(std::span<const View> screens) const;
  [[nodiscard]] std::uint32_t most_samples() const;
  [[nodiscard]] std::vector<std::string> all_to_give_up() const;

  Session& session_;
  FrameSettings settings_;  ///< with nothing given up
  Sampling sampling_;
  Sampling resting_;
  std::optional<double> target_ms_;
  bool keeps_keys_;
  std::vector<std::string> economies_;
  std::optional<FrameBudget> budget_;
  Effort effort_;  ///< that plan_ is for
  Blocks blocks_;
  FramePlan plan_;
  std::vector<View> last_screens_;
  std::unique_ptr<FrameSampler> sampler_;  ///< of the frame at hand, or the picture that is refined
  bool refining_ = false;
  FrameTimes times_;
  FrameTimes times_before_;
  std::optional<double> relmse_;
  std::optional<BudgetReport> report_;
};

}  // namespace hpr
