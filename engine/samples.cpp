#include "engine/samples.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <limits>

#include "cluster/transport/collectives.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/text.h"
#include "engine/film.h"
#include "rt/sampling/sampler.h"

namespace hpr {
namespace {

/// A number of a screen that no wall has: the jitter of the whole frame has a stream of its own.
constexpr std::uint32_t kNoScreen = 0xFFFFFFFFU;

/// An estimate from fewer samples may be small by chance.
constexpr std::uint32_t kMinForError = 16;

[[noreturn]] void refuse(const std::string& text) {
  throw Error(ExitCode::Usage, fmt::format("--spp: '{}' is no number of samples", printable(text)),
              "write e.g. 16, until:60s or until:relmse=1e-3");
}

template <typename Number>
std::optional<Number> parse_whole(std::string_view text) {
  Number number{};
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, number);
  if (error != std::errc() || stop != end) return std::nullopt;
  return number;
}

}  // namespace

SampleGoal parse_sample_goal(const std::string& text) {
  constexpr std::string_view kUntil = "until:";
  constexpr std::string_view kError = "relmse=";
  if (!text.starts_with(kUntil)) {
    const auto samples = parse_whole<std::uint32_t>(text);
    if (!samples || *samples == 0 || *samples == std::numeric_limits<std::uint32_t>::max()) refuse(text);
    return {samples, {}, {}};
  }
  const std::string_view condition = std::string_view(text).substr(kUntil.size());
  if (condition.starts_with(kError)) {
    const auto relmse = parse_whole<double>(condition.substr(kError.size()));
    if (!relmse || !(*relmse > 0.0) || !std::isfinite(*relmse)) refuse(text);
    return {{}, {}, relmse};
  }
  const auto duration = parse_duration(condition);
  if (!duration || duration->count() <= 0) refuse(text);
  return {{}, std::chrono::duration<double>(*duration).count(), {}};
}

std::uint32_t min_samples(const Sampling& sampling) {
  return static_cast<std::uint32_t>(min_samples(sampling.filter.value_or(PixelFilter::Box)));
}

void check_sampling(const Sampling& sampling) {
  if (!sampling.goal.samples || *sampling.goal.samples >= min_samples(sampling)) return;
  throw Error(ExitCode::Usage,
              fmt::format("--filter {} needs {} samples, as some of its weights are negative",
                          name_of(*sampling.filter), min_samples(sampling)),
              fmt::format("use --spp {} or more, or another filter", min_samples(sampling)));
}

FilterSample subpixel_sample(const Sampling& sampling, const RandomKey& random, std::uint32_t number) {
  if (!sampling.sums()) return {};
  Sampler sampler(pixel_stream(random, kNoScreen, 0, 0), number);
  return sample_filter(sampling.filter.value_or(PixelFilter::Box), sampler.two_of_pixel());
}

bool is_milestone(std::uint32_t samples) {
  if (samples < 4) return samples > 0;
  return samples % (std::bit_floor(samples) / 4) == 0;
}

bool reached(const Sampling& sampling, const SampleProgress& progress) {
  const SampleGoal& goal = sampling.goal;
  if (progress.samples < min_samples(sampling)) return false;
  if (progress.samples == std::numeric_limits<std::uint32_t>::max()) return true;
  if (goal.samples && progress.samples >= *goal.samples) return true;
  if (goal.seconds && progress.seconds >= *goal.seconds) return true;
  return goal.relmse && progress.relmse && progress.samples >= kMinForError && *progress.relmse <= *goal.relmse;
}

std::optional<double> remaining_seconds(const SampleGoal& goal, const SampleProgress& progress) {
  if (progress.samples == 0) return std::nullopt;
  const double each = progress.seconds / progress.samples;
  std::optional<double> left;
  const auto consider = [&](double seconds) { left = std::min(left.value_or(seconds), std::max(seconds, 0.0)); };
  if (goal.samples) consider(each * (static_cast<double>(*goal.samples) - progress.samples));
  if (goal.seconds) consider(*goal.seconds - progress.seconds);
  if (goal.relmse && progress.relmse) consider(progress.seconds * (*progress.relmse / *goal.relmse - 1.0));
  return left;
}

namespace {

/// Fewer samples are too few to estimate a variance.
constexpr std::uint32_t kMinFirstStage = 8;
constexpr std::uint32_t kMaxSamples = AdaptiveSampling::kMaxSamples;
constexpr std::size_t kLevels = 32;  ///< of powers of two

/// Samples in proportion to this power of the variance.
constexpr double kExponent = 0.4;
/// Weight of a pixel's own variance against the mean variance of the 3 x 3 pixels around it.
constexpr double kOwnWeight = 0.5;

/// Pixels are sorted by the samples they want: so many bins for a factor of 2.
constexpr int kBinsPerLevel = 16;
constexpr int kBins = 1024;
constexpr int kCalm = -1;  ///< the bin of pixels whose samples are all the same
using Histogram = std::array<std::uint64_t, kBins>;
using TileBins = std::array<std::int16_t, kTilePixels>;

template <typename Counts>
Counts sum_over_ranks(Communicator& comm, const Counts& mine) {
  Counts sum{};
  for (const Counts& each : all_gather_value(comm, mine)) {
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += each[i];
  }
  return sum;
}

std::size_t index_of(int column, int row) {
  return static_cast<std::size_t>(row) * kTileSide + static_cast<std::size_t>(column);
}

/// Calls `body` with the index, column and row of each pixel of a tile that is in the picture.
template <typename Body>
void each_pixel(const Rect& rect, const Body& body) {
  for (int y = 0; y < rect.height(); ++y) {
    for (int x = 0; x < rect.width(); ++x) body(index_of(x, y), x, y);
  }
}

double mean_about(std::span<const double> values, const Rect& rect, int column, int row) {
  double sum = 0.0;
  int count = 0;
  for (int y = std::max(row - 1, 0); y < std::min(row + 2, rect.height()); ++y) {
    for (int x = std::max(column - 1, 0); x < std::min(column + 2, rect.width()); ++x) {
      sum += values[index_of(x, y)];
      ++count;
    }
  }
  return sum / count;
}

/// Per pixel its bin.
TileBins bins_of(const Film& film, std::size_t tile) {
  const Rect rect = film.layout().place(tile).pixels;
  const std::vector<double> variances = film.variances(tile);
  TileBins bins;
  bins.fill(kCalm);
  each_pixel(rect, [&](std::size_t i, int x, int y) {
    const double variance = kOwnWeight * variances[i] + (1.0 - kOwnWeight) * mean_about(variances, rect, x, y);
    if (!(variance > 0.0)) return;
    const double bin = kBins / 2.0 + std::round(kBinsPerLevel * kExponent * std::log2(variance));
    bins[i] = static_cast<std::int16_t>(std::clamp(bin, 0.0, kBins - 1.0));
  });
  return bins;
}

/// The power of two not above so many.
int level_of(std::uint32_t samples) {
  return static_cast<int>(std::bit_width(samples)) - 1;
}

/// Powers of two of samples that a stage may give.
struct Levels {
  int lowest = 0;
  int highest = 0;

  Levels(std::uint32_t budget, std::uint32_t pilot)
      : lowest(level_of(std::max(budget / 4, pilot))),
        highest(level_of(std::bit_ceil(2 * std::min(budget, kMaxSamples / 2)))) {}

  [[nodiscard]] int of(int bin, int shift) const {
    if (bin == kCalm) return lowest;
    const double level = std::floor(static_cast<double>(bin + shift) / kBinsPerLevel + 0.5);
    return static_cast<int>(std::clamp<double>(level, lowest, highest));
  }
};

/// The largest shift of bins with which the pixels in them get no more than the budget on average.
int shift_within(const Histogram& pixels, const Levels& levels, std::uint32_t budget) {
  double most = 0.0;
  for (const std::uint64_t count : pixels) most += static_cast<double>(budget) * static_cast<double>(count);
  const auto fits = [&](int shift) {
    double sum = 0.0;
    for (int bin = 0; bin < kBins; ++bin) {
      sum += std::ldexp(static_cast<double>(pixels[static_cast<std::size_t>(bin)]), levels.of(bin, shift));
    }
    return sum <= most;
  };
  int low = -kBins;  // all bins at the lowest level
  int high = kBins + kBinsPerLevel * static_cast<int>(kLevels);
  while (high - low > 1) {
    const int mid = low + (high - low) / 2;
    (fits(mid) ? low : high) = mid;
  }
  return low;
}

}  // namespace

std::uint32_t AdaptiveSampling::pilot_of(const Sampling& sampling) {
  const std::uint32_t min_pilot = std::max(kMinFirstStage, min_samples(sampling));
  if (!sampling.goal.samples) return min_pilot;
  std::uint32_t pilot = *sampling.goal.samples;
  while (std::bit_floor(pilot / 4) >= min_pilot) pilot = std::bit_floor(pilot / 4);
  if (pilot == *sampling.goal.samples && pilot >= kMinPilot) pilot = min_pilot;
  return pilot;
}

AdaptiveSampling::AdaptiveSampling(const Sampling& sampling) : sampling_(sampling), budget_(pilot_of(sampling)) {
  steps_.push_back({0, budget_, 0, 1});
  total_ = budget_;
}

std::uint32_t AdaptiveSampling::budget_after(std::uint32_t budget) const {
  if (!sampling_.goal.samples) return std::min(4 * budget, kMaxSamples / 2);
  std::uint32_t next = *sampling_.goal.samples;
  while (std::bit_floor(next / 4) > budget) next = std::bit_floor(next / 4);
  return next;
}

void AdaptiveSampling::find_steps(Communicator& comm, const Film& film, std::span<const std::size_t> tiles,
                                  std::uint32_t from) {
  std::array<std::uint64_t, kLevels> mine{};
  for (const std::size_t tile : tiles) {
    const std::span<const PixelSamples> pixels = film.pixel_samples().tile(tile);
    each_pixel(film.layout().place(tile).pixels, [&](std::size_t i, int, int) {
      for (std::uint32_t next = std::max(pixels[i].sample_count, 1U); next < pixels[i].wanted;
           next = std::bit_ceil(next + 1)) {
        ++mine[static_cast<std::size_t>(level_of(next))];
      }
    });
  }
  const auto pixels = sum_over_ranks(comm, mine);
  steps_.clear();
  total_ = done_ = 0;
  for (std::size_t level = 0; level < kLevels; ++level) {
    if (pixels[level] == 0) continue;
    const std::uint32_t begin = std::uint32_t{1} << level;
    // A step that was broken off goes on.
    const std::uint32_t number = steps_.empty() && from > begin ? std::min(from, 2 * begin - 1) : begin;
    steps_.push_back({begin, 2 * begin, number, pixels[level]});
    total_ += pixels[level] * (steps_.back().end - steps_.back().number);
  }
}

void AdaptiveSampling::resume(Communicator& comm, const SampleProgress& reached, const Film& film,
                              std::span<const std::size_t> tiles) {
  budget_ = reached.budget;
  before_ = reached.samples;
  if (film.samples() < film.pilot()) {
    steps_.front().number = film.samples();
    done_ = film.samples();
    before_ = 0;
    return;
  }
  find_steps(comm, film, tiles, film.samples());
}

void AdaptiveSampling::start_stage(Communicator& comm, Film& film, std::span<const std::size_t> tiles, int threads) {
  do {
    before_ = budget_;
    budget_ = budget_after(budget_);
    choose(comm, film, tiles, threads);
    find_steps(comm, film, tiles, 0);
  } while (steps_.empty() && budget_after(budget_) > budget_);
  if (!steps_.empty()) film.set_next_sample(steps_.front().number);
}

void AdaptiveSampling::choose(Communicator& comm, Film& film, std::span<const std::size_t> tiles, int threads) const {
  std::vector<TileBins> bins(tiles.size());
  parallel_for(threads, tiles.size(), [&](std::size_t i) { bins[i] = bins_of(film, tiles[i]); });
  Histogram mine{};
  for (const TileBins& tile : bins) {
    for (const std::int16_t bin : tile) {
      if (bin != kCalm) ++mine[static_cast<std::size_t>(bin)];
    }
  }
  const Levels levels(budget_, film.pilot());
  const int shift = shift_within(sum_over_ranks(comm, mine), levels, budget_);
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const std::span<PixelSamples> pixels = film.pixel_samples().tile(tiles[i]);
    each_pixel(film.layout().place(tiles[i]).pixels, [&](std::size_t pixel, int, int) {
      pixels[pixel].wanted = std::uint32_t{1} << static_cast<unsigned int>(levels.of(bins[i][pixel], shift));
    });
  }
}

void AdaptiveSampling::added(std::uint32_t count, Film& film) {
  Step& step = steps_.front();
  step.number += count;
  done_ += count * step.pixels;
  if (step.number < step.end) return;
  steps_.erase(steps_.begin());
  if (!steps_.empty()) film.set_next_sample(steps_.front().number);
}

std::uint32_t AdaptiveSampling::samples() const {
  if (steps_.empty() || budget_ <= before_) return budget_;
  const double fraction = static_cast<double>(done_) / static_cast<double>(total_);
  const auto more = static_cast<std::uint32_t>(fraction * static_cast<double>(budget_ - before_));
  return before_ + std::min(more, budget_ - before_ - 1);
}

}  // namespace hpr
