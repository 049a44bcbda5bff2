#include <array>
#include <cmath>
#include <cstdint>
#include <type_traits>
#include <utility>
#include <vector>

#include "engine/film.h"
#include "tools/stability/stability.h"
#include "tools/stability/tools.h"

// A million samples in a film: what its sums lose against sums in twice the digits.
namespace hpr::stability {
namespace {

constexpr std::uint32_t kSamples = 1'000'000;
constexpr std::size_t kColors = 16;
/// Share of samples with the weight -1: Mitchell's filter.
constexpr double kNegative = 0.06;

/// A tile of colours, each pixel with its own.
struct Sample {
  explicit Sample(const FrameLayout& layout) : radiance(layout), keys(layout) { radiance.set_active(0); }

  TileLayer<Rgb> radiance;
  AovLayers aovs;
  TileLayer<Key> keys;
};

std::array<double, 3> channels(const ColorSum& sum) {
  return {sum.r, sum.g, sum.b};
}
std::array<double, 3> channels(const Rgb& color) {
  return {color.r, color.g, color.b};
}

/// Adds samples drawn from a few tiles of colours that span `decades`, and keeps count of how often each was.
class LongExposure {
 public:
  LongExposure(double decades, std::uint64_t seed)
      : layout_({{kTileSide, kTileSide}}), film_(layout_, {}), random_(seed) {
    for (std::size_t i = 0; i < kColors; ++i) {
      Sample& sample = samples_.emplace_back(layout_);
      const auto value = [&] { return static_cast<float>(std::pow(10.0, decades * (random_.one() - 0.5))); };
      for (Rgb& color : sample.radiance.tile(0)) color = {value(), value(), value()};
    }
  }

  void expose(std::uint32_t samples) {
    const std::array<std::size_t, 1> tile{0};
    for (std::uint32_t i = 0; i < samples; ++i) {
      const std::size_t which = random_.below(kColors);
      const double weight = random_.one() < kNegative ? -1.0 : 1.0;
      const SampleLight light{samples_[which].radiance, samples_[which].aovs, samples_[which].keys};
      film_.add({&light, 1}, {&weight, 1}, tile, 1);
      (weight < 0.0 ? negative_ : positive_).at(which) += 1;
    }
  }

  struct Errors {
    double sum = 0.0;   ///< of the film's sums, relative to the sum of what was added without its sign
    double mean = 0.0;  ///< of the mean as a float, relative to the same over the sum of weights
  };
  [[nodiscard]] Errors errors() {
    std::array<TileLayer<ColorSum>*, 2> halves{};
    std::size_t found = 0;
    film_.each_layer([&](auto& layer) {
      if constexpr (std::is_same_v<decltype(layer), TileLayer<ColorSum>&>) halves.at(found++) = &layer;
    });
    TileLayer<Rgb> mean(layout_);
    AovLayers none;
    film_.resolve(all_tiles(layout_), 1, mean, none);
    long double weights = 0.0L;
    for (std::size_t i = 0; i < kColors; ++i) weights += positive_.at(i) - negative_.at(i);
    Errors worst;
    for (std::size_t pixel = 0; pixel < kTilePixels; ++pixel) {
      const auto even = channels(halves[0]->tile(0)[pixel]);
      const auto odd = channels(halves[1]->tile(0)[pixel]);
      const auto shown = channels(mean.tile(0)[pixel]);
      for (std::size_t channel = 0; channel < 3; ++channel) {
        ExactSum exact;
        ExactSum size;
        for (std::size_t i = 0; i < kColors; ++i) {
          const long double value = channels(samples_[i].radiance.tile(0)[pixel]).at(channel);
          exact.add(value * (positive_.at(i) - negative_.at(i)));
          size.add(value * (positive_.at(i) + negative_.at(i)));
        }
        const long double summed = static_cast<long double>(even.at(channel)) + odd.at(channel);
        worst.sum = worse(worst.sum, static_cast<double>(std::abs(summed - exact.sum) / size.sum));
        const long double off = std::abs(shown.at(channel) - exact.sum / weights);
        worst.mean = worse(worst.mean, static_cast<double>(off / (size.sum / weights)));
      }
    }
    return worst;
  }

 private:
  FrameLayout layout_;
  Film film_;
  RandomStream random_;
  std::vector<Sample> samples_;
  std::array<long double, kColors> positive_{};  ///< how often each was added
  std::array<long double, kColors> negative_{};
};

std::vector<StabilityFinding> measure_accumulator(const Globals& globals) {
  StabilityFinding sums = make_finding("accumulator/sums", "1e3 .. 1e6 samples over 12 decades, 6 % of them negative",
                                       0.5 * kSamples * kDoubleRounding, "relative to the sum of sizes",
                                       "n / 2 additions to each of two sums, 2^-53 each");
  sums.curve.x = "samples";
  StabilityFinding mean = make_finding("accumulator/mean", "the picture after 1e6 such samples",
                                       kFloatRounding + (0.5 * kSamples + 3.0) * kDoubleRounding,
                                       "relative to the mean size", "one rounding to float beside the sums' own error");
  LongExposure wide(12.0, globals.seed);
  std::uint32_t before = 0;
  for (const std::uint32_t samples : {1'000U, 10'000U, 100'000U, kSamples}) {
    wide.expose(samples - std::exchange(before, samples));
    const LongExposure::Errors errors = wide.errors();
    add_point(sums, samples, errors.sum);
    mean.measured = worse(mean.measured, errors.mean);
    sums.curve.expected.emplace_back(samples, 0.5 * samples * kDoubleRounding);
  }

  StabilityFinding alike =
      make_finding("accumulator/like-sizes", "1e5 samples within a factor of 8", 0.0, "relative to the sum of sizes",
                   "24 bits each, 3 of spread and 17 of count: 44 of 53");
  LongExposure narrow(std::log10(8.0), globals.seed);
  narrow.expose(100'000);
  alike.measured = narrow.errors().sum;
  return {sums, mean, alike};
}

}  // namespace

StabilityCase accumulator_case() {
  return {"accumulator", "a million samples of a pixel: what the film's sums lose", measure_accumulator};
}

}  // namespace hpr::stability
