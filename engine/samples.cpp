#include "engine/samples.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/text.h"

namespace hpr {
namespace {

/// A number of a screen that no wall has: what shakes the whole frame has a stream of its own.
constexpr std::uint32_t kNoScreen = 0xFFFFFFFFU;

/// An estimate from fewer samples may be small by chance.
constexpr std::uint32_t kLeastForError = 16;

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
  const std::string_view rest = std::string_view(text).substr(kUntil.size());
  if (rest.starts_with(kError)) {
    const auto relmse = parse_whole<double>(rest.substr(kError.size()));
    if (!relmse || !(*relmse > 0.0) || !std::isfinite(*relmse)) refuse(text);
    return {{}, {}, relmse};
  }
  const auto duration = parse_duration(rest);
  if (!duration || duration->count() <= 0) refuse(text);
  return {{}, std::chrono::duration<double>(*duration).count(), {}};
}

std::uint32_t least_samples(const Sampling& sampling) {
  return static_cast<std::uint32_t>(least_samples(sampling.filter.value_or(PixelFilter::Box)));
}

void check_sampling(const Sampling& sampling) {
  if (!sampling.goal.samples || *sampling.goal.samples >= least_samples(sampling)) return;
  throw Error(ExitCode::Usage,
              fmt::format("--filter {} needs {} samples, as some of its weights are negative",
                          name_of(*sampling.filter), least_samples(sampling)),
              fmt::format("use --spp {} or more, or another filter", least_samples(sampling)));
}

FilterSample look_through(const Sampling& sampling, const RandomKey& random, std::uint32_t number) {
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
  if (progress.samples < least_samples(sampling)) return false;
  if (progress.samples == std::numeric_limits<std::uint32_t>::max()) return true;
  if (goal.samples && progress.samples >= *goal.samples) return true;
  if (goal.seconds && progress.seconds >= *goal.seconds) return true;
  return goal.relmse && progress.relmse && progress.samples >= kLeastForError && *progress.relmse <= *goal.relmse;
}

std::optional<double> seconds_left(const SampleGoal& goal, const SampleProgress& progress) {
  if (progress.samples == 0) return std::nullopt;
  const double each = progress.seconds / progress.samples;
  std::optional<double> left;
  const auto consider = [&](double seconds) { left = std::min(left.value_or(seconds), std::max(seconds, 0.0)); };
  if (goal.samples) consider(each * (static_cast<double>(*goal.samples) - progress.samples));
  if (goal.seconds) consider(*goal.seconds - progress.seconds);
  if (goal.relmse && progress.relmse) consider(progress.seconds * (*progress.relmse / *goal.relmse - 1.0));
  return left;
}

}  // namespace hpr
