#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace hpr {

struct FrameSettings;
struct PassPlan;

/// How many sizes a frame may have, from full size down to a tenth of the pixels a side; each has an eighth fewer
/// pixels than the one before.
inline constexpr int kScaleSteps = 40;

/// The share of the pixels a side; step 0 is all of them.
[[nodiscard]] double scale_of_step(int step);

/// What a frame is made with.
struct Effort {
  std::uint32_t samples = 1;
  int degradations = 0;  ///< how many of the list are made, from its front
  int scale_step = 0;    ///< see scale_of_step

  bool operator==(const Effort&) const = default;
};

/// What a frame with a target time was made with, as reports show it.
struct BudgetReport {
  double target_ms = 0.0;
  double resolution_scale = 1.0;      ///< of the screens' pixels a side
  std::uint32_t samples = 1;          ///< of the picture shown
  std::vector<std::string> given_up;  ///< in the order in which it is
  bool resting = false;               ///< it added to a picture seen from one place, and has no target
};

struct BudgetSettings {
  double target_ms = 33.0;
  std::uint32_t max_samples = 1;
  int degradations = 0;  ///< how many there are
};

/// Steers the effort from frame to frame so that frames take a target time.
///
/// Efforts form a ladder: samples are given up first, by halves, then one degradation after the other, then pixels. The
/// time of a frame is taken to be fixed + work * each, work being samples times the share of pixels; both are tracked
/// by a Kalman filter whose `each` drifts faster than its `fixed`. A single surprising time is ignored, two in a row
/// are believed at once. The aim lies below the target by as much as times scatter, so that 95 % of the frames keep it.
/// The effort stays inside a dead band about the aim, falls as far as it must and rises by a few rungs at a time. Where
/// fewer pixels save next to nothing they are not given up: a scene may have a cost that does not scale.
///
/// A function of the recorded times alone: ranks that record the same times decide alike.
class FrameBudget {
 public:
  explicit FrameBudget(const BudgetSettings& settings);

  /// For the next frame.
  [[nodiscard]] const Effort& effort() const { return ladder_[rung_]; }
  /// What the frame made with effort() took, in ms; chooses the next one's. Times that are not above 0 are ignored.
  void record_frame_time(double ms);
  /// What a frame of effort() should take.
  [[nodiscard]] double predicted_ms() const { return predict(rung_); }

 private:
  [[nodiscard]] double work(std::size_t rung) const;
  [[nodiscard]] double predict(std::size_t rung) const;
  [[nodiscard]] double degradation_ratio(int from, int to) const;
  [[nodiscard]] std::size_t best_within(double ms) const;
  /// Whether the time was believed.
  bool update_model(double ms);
  void update_degradation();
  void choose();
  void move_to(std::size_t rung);

  BudgetSettings settings_;
  std::vector<Effort> ladder_;  ///< from the best to the least
  std::size_t rung_ = 0;

  bool started_ = false;
  double fixed_ms_ = 0.0;
  double each_ms_ = 0.0;  ///< of a whole sample, with the degradations of the present rung
  double fixed_variance_ = 0.0;
  double each_variance_ = 0.0;
  double covariance_ = 0.0;
  double scatter_ = 0.05;  ///< standard deviation of times about their prediction, relative
  int surprises_ = 0;      ///< in a row
  bool moved_ = false;     ///< since the last time that was believed
  int frames_out_of_reach_ = 0;

  std::vector<double> ratios_;   ///< per degradation: what `each` becomes by it
  int degradations_before_ = 0;  ///< before the last change of them
  double each_before_ = 0.0;     ///< each_ms_ at that change
  int frames_since_ = 0;         ///< believed ones since then
};

/// What a frame of these settings may do without, in the order in which it is given up: "half-resolution" of all passes
/// that have one, "photons", "glossy-cutoff" (and chains of reflections past the second). `passes`: those of the
/// frame's plan; what would save nothing is left out. `on_device`: whether a device lights; it does not at half
/// resolution, and a frame that the CPU lights instead would take longer.
[[nodiscard]] std::vector<std::string> degradations_for(const FrameSettings& settings, std::span<const PassPlan> passes,
                                                        bool on_device = false);

/// The settings with these degradations made.
[[nodiscard]] FrameSettings apply_degradations(FrameSettings settings, std::span<const std::string> degradations);

}  // namespace hpr
