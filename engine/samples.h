#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "image/filter.h"
#include "rt/deferred_shader.h"
#include "rt/sampling/sampler.h"

namespace hpr {

/// When a frame has enough samples: whichever is set, the first to be reached counts.
struct SampleGoal {
  std::optional<std::uint32_t> samples = 1;
  std::optional<double> seconds;
  std::optional<double> relmse;  ///< estimated, see estimated_relmse

  /// Whether a frame is a single look through the pixels' centres (unless a filter is asked for).
  [[nodiscard]] bool one() const { return samples == std::uint32_t{1}; }
};

/// "16", "until:60s" or "until:relmse=1e-3". Throws Error (Usage).
[[nodiscard]] SampleGoal parse_sample_goal(const std::string& text);

/// How a frame is sampled.
struct Sampling {
  SampleGoal goal;
  std::optional<PixelFilter> filter;  ///< none: box for several samples, the pixel's centre for one
  bool adaptive = false;              ///< more samples for pixels whose samples differ more, as many on average

  /// Whether frames are summed at all.
  [[nodiscard]] bool sums() const { return !goal.one() || filter.has_value(); }
};

/// How many samples the filter needs.
[[nodiscard]] std::uint32_t least_samples(const Sampling& sampling);

/// Throws Error (Usage) where a filter needs more samples than are asked for.
void check_sampling(const Sampling& sampling);

/// Where sample `number` of a frame looks through its pixels, all of them through the same place: a Sobol' sequence,
/// scrambled by the seed and the frame.
[[nodiscard]] FilterSample look_through(const Sampling& sampling, const RandomKey& random, std::uint32_t number);

/// The numbers of samples after which progress is told and errors are estimated: a power of two, or a multiple of a
/// quarter of the one below.
[[nodiscard]] bool is_milestone(std::uint32_t samples);

/// What is known after some samples.
struct SampleProgress {
  std::uint32_t samples = 0;
  double seconds = 0.0;          ///< since the first sample began, interruptions left out
  std::optional<double> relmse;  ///< at the last milestone
  std::uint32_t budget = 0;      ///< adaptive: samples there will be at the end of the stage at hand
};

/// Whether the goal is reached. No goal is before a filter has the samples it needs, and a relative error is believed
/// only past 16 samples.
[[nodiscard]] bool reached(const Sampling& sampling, const SampleProgress& progress);

/// The rest of the time, guessed: noise falls as one over the samples. None when there is nothing to guess from.
[[nodiscard]] std::optional<double> seconds_left(const SampleGoal& goal, const SampleProgress& progress);

}  // namespace hpr
