#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "app/doctor/doctor.h"
#include "engine/render_settings.h"
#include "image/image.h"
#include "rt/deferred_shader.h"

namespace hpr {

/// One value per knob, in the order the user named the knobs.
using KnobValues = std::vector<std::pair<std::string, std::string>>;

/// One `--vary K=V,V,...`.
struct KnobSweep {
  std::string knob;
  std::vector<std::string> values;
};

/// "spp=1,4,16". Throws Error (Usage) for unknown knobs, missing and repeated values.
[[nodiscard]] KnobSweep parse_knob_sweep(const std::string& text);

/// Every combination, the last sweep's values varying fastest. Throws Error (Usage) for a knob named twice.
[[nodiscard]] std::vector<KnobValues> combinations(std::span<const KnobSweep> sweeps);

/// `base` with these knobs set; a list within a value has + in place of its commas. Throws Error (Usage).
[[nodiscard]] RenderSettings with_knobs(const RenderSettings& base, const KnobValues& values);

/// How far a picture is from the reference; what was not asked for, or is not defined, is NaN.
struct PictureError {
  double rmse = 0.0;
  double relmse = 0.0;      ///< without the worst pixels, see RelativeError
  double relmse_all = 0.0;  ///< with them
  double psnr = 0.0;        ///< dB of display values, against a peak of 1
  double ssim = 0.0;
  double flip = 0.0;
  double mean = 0.0;        ///< signed: of picture - reference
  double mean_error = 0.0;  ///< its standard error
  double worst = 0.0;       ///< largest difference of a value
  std::size_t worst_pixel = 0;

  /// By name; throws Error (Usage) for those that are none of tradeoff_metrics().
  [[nodiscard]] double of(const std::string& metric) const;
};

/// The metrics a sweep may be judged by: relmse, rmse, psnr, ssim, flip.
[[nodiscard]] const std::vector<std::string>& tradeoff_metrics();
/// An error by `metric`, 0 for equal pictures, of which more is worse: 1 - ssim, 10^(-psnr / 20), the
/// others as they are.
[[nodiscard]] double badness(const std::string& metric, double value);

/// What one combination of knobs took and how far off it is.
struct TradeoffPoint {
  KnobValues knobs;
  std::vector<double> ms;       ///< of each frame measured: the slowest rank, from the first triangle to the picture
                                ///< on rank 0
  std::vector<PassTime> times;  ///< of the last of them
  RayCounts rays;               ///< of the last of them
  std::size_t bytes_sent = 0;   ///< by the last of them
  int samples = 1;
  PictureError error;
  bool pareto = false;
  std::string crop_png;  ///< base64: a part of the picture, and
  std::string flip_png;  ///< of the map of errors seen there

  [[nodiscard]] double median_ms() const;
};

/// Marks the points that no other is at least as good as in both time and `metric`, and better in one.
void mark_pareto(std::span<TradeoffPoint> points, const std::string& metric);

/// "33ms", "2s", or "flip=0.05", "psnr=40".
struct TradeoffBudget {
  std::optional<double> ms;
  std::string metric = {};  ///< with `error`
  double error = 0.0;
};
/// Throws Error (Usage).
[[nodiscard]] TradeoffBudget parse_budget(const std::string& text);

/// Within time the most accurate point by `metric`, the fastest of several; within an error the fastest. None when no
/// point is within.
[[nodiscard]] std::optional<std::size_t> best_within(std::span<const TradeoffPoint> points,
                                                     const TradeoffBudget& budget, const std::string& metric);

/// How an error goes with one knob while the others stand still: the slope of a least-squares line through (log value,
/// log badness).
struct KnobSlope {
  std::string knob;
  KnobValues others;
  std::string metric;
  double slope = 0.0;
  double spread = 0.0;  ///< standard error of the slope; 0 for two points
  std::size_t points = 0;
};

/// For every knob whose values are positive numbers, every setting of the others with two points or more, and each
/// metric. Points without error are left out.
[[nodiscard]] std::vector<KnobSlope> knob_slopes(std::span<const TradeoffPoint> points,
                                                 std::span<const std::string> metrics);

/// What a sweep was held against.
struct TradeoffReference {
  std::string how;        ///< "path tracing", "passes at best", or a file's name
  std::uint64_t spp = 0;  ///< 0: unknown
  double relmse = 0.0;    ///< what is left of its own noise, estimated; NaN: unknown
  double mean = 0.0;      ///< of its values: what signed means of errors are shares of
  bool cached = false;
};

/// A whole sweep.
struct TradeoffReport {
  std::string scene;
  std::string command;
  Machine machine;
  int ranks = 1;
  int threads = 1;
  Size size;
  std::uint64_t seed = 1;
  TradeoffReference reference;
  std::vector<std::string> knobs;
  std::vector<std::string> metrics;  ///< the first one decides the front
  std::vector<TradeoffPoint> points;
  std::optional<TradeoffBudget> budget;
  std::optional<std::size_t> best;        ///< within the budget
  std::string reference_crop_png;         ///< base64
  std::vector<std::string> base_options;  ///< words of the command line that hold for all points
};

}  // namespace hpr
