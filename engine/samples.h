#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "image/filter.h"

namespace hpr {

class Communicator;
class Film;
struct RandomKey;

/// When a frame has enough samples: whichever is set, the first to be reached counts.
struct SampleGoal {
  std::optional<std::uint32_t> samples = 1;
  std::optional<double> seconds;
  std::optional<double> relmse;  ///< estimated, see estimated_relmse

  /// Whether a frame is one sample through the pixels' centers (unless a filter is set).
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
[[nodiscard]] std::uint32_t min_samples(const Sampling& sampling);

/// Throws Error (Usage) where a filter needs more samples than the goal has.
void check_sampling(const Sampling& sampling);

/// The subpixel position and weight of sample `number` of a frame, equal for all its pixels: a Sobol' sequence,
/// scrambled by the seed and the frame.
[[nodiscard]] FilterSample subpixel_sample(const Sampling& sampling, const RandomKey& random, std::uint32_t number);

/// Whether progress is reported and the error estimated after so many samples: a power of two, or a multiple of a
/// quarter of the one below.
[[nodiscard]] bool is_milestone(std::uint32_t samples);

/// State of a frame after some samples.
struct SampleProgress {
  std::uint32_t samples = 0;
  double seconds = 0.0;          ///< since the first sample began, interruptions left out
  std::optional<double> relmse;  ///< at the last milestone
  std::uint32_t budget = 0;      ///< adaptive: samples there will be at the end of the stage at hand
};

/// Whether the goal is reached. No goal is before a filter has the samples it needs, and a relative error is believed
/// only past 16 samples.
[[nodiscard]] bool reached(const Sampling& sampling, const SampleProgress& progress);

/// Estimated seconds until the goal, as noise falls as one over the samples. None without a first sample.
[[nodiscard]] std::optional<double> remaining_seconds(const SampleGoal& goal, const SampleProgress& progress);

/// Decides which pixels of an adaptive film get which samples, in stages, each of about four times as many samples as
/// the one before. The first gives every pixel the same, a later one gives each between a quarter and twice as many as
/// a pixel gets on average (the powers of two about that, where it is none), more where its samples and its neighbours'
/// differ more; always a power of two, so that what a pixel has is a whole net of its sequence. Samples of a pixel
/// whose variance is v have an error of about v n^-1.5 in outlines and v / n elsewhere; with n in proportion to v^0.4
/// the next sample is worth the same everywhere (Neyman's allocation, for an exponent between the two).
///
/// All pixels of the frame share the samples, and neighbours are those of the same tile: ranks, threads and ways of
/// compositing change nothing. The mean of pixels that chance made look calm is a little off: samples decide how many
/// more there are. The quarter that every pixel gets bounds that.
class AdaptiveSampling {
 public:
  /// How many samples every pixel has before their variance is believed; all of them where fewer than kMinPilot are
  /// asked for.
  [[nodiscard]] static std::uint32_t pilot_of(const Sampling& sampling);
  static constexpr std::uint32_t kMinPilot = 16;
  /// The most that a pixel is given.
  static constexpr std::uint32_t kMaxSamples = std::uint32_t{1} << 30U;

  explicit AdaptiveSampling(const Sampling& sampling);

  /// Collective. Goes on where the checkpoint ended that `film` and `reached` were read from. `tiles`: this rank's.
  void resume(Communicator& comm, const SampleProgress& reached, const Film& film, std::span<const std::size_t> tiles);

  /// Whether start_stage() has to come before the next sample.
  [[nodiscard]] bool is_stage_done() const { return steps_.empty(); }
  /// Collective. Begins the next stage in which any pixel wants more: decides what each pixel of `tiles` wants, this
  /// rank's. Where there is none before the goal, all samples of the goal are taken.
  void start_stage(Communicator& comm, Film& film, std::span<const std::size_t> tiles, int threads);

  /// How many samples from the film's next one on go to the same pixels.
  [[nodiscard]] std::uint32_t max_batch() const { return steps_.front().end - steps_.front().number; }
  /// Called after `count` samples were added: chooses the number of the film's next sample.
  void added(std::uint32_t count, Film& film);

  /// Samples of a pixel, on average, at the end of the stage at hand.
  [[nodiscard]] std::uint32_t budget() const { return budget_; }
  /// Samples of a pixel so far, on average: those of finished stages and the finished fraction of the current one.
  [[nodiscard]] std::uint32_t samples() const;
  /// Whether every pixel has a power of two of them.
  [[nodiscard]] bool at_milestone() const { return steps_.empty() || steps_.front().number == steps_.front().begin; }

 private:
  /// Samples [begin, end) of the pixels that have those before and want these.
  struct Step {
    std::uint32_t begin = 0;
    std::uint32_t end = 0;
    std::uint32_t number = 0;  ///< of the next one
    std::uint64_t pixels = 0;  ///< of all ranks
  };

  [[nodiscard]] std::uint32_t budget_after(std::uint32_t budget) const;
  /// Finds the steps of a stage that are left from a sample on.
  void find_steps(Communicator& comm, const Film& film, std::span<const std::size_t> tiles, std::uint32_t from);
  /// Decides what pixels want in the stage at hand.
  void choose(Communicator& comm, Film& film, std::span<const std::size_t> tiles, int threads) const;

  Sampling sampling_;
  std::uint32_t budget_ = 0;  ///< of the stage at hand
  std::uint32_t before_ = 0;  ///< samples of a pixel, on average, when its steps were found
  std::vector<Step> steps_;   ///< that are left
  std::uint64_t total_ = 0;   ///< of the stage's steps: samples times pixels
  std::uint64_t done_ = 0;
};

}  // namespace hpr
