#include "app/film.h"

#include <algorithm>
#include <cstring>
#include <limits>

#include "cluster/collectives.h"
#include "core/check.h"
#include "core/parallel.h"

namespace hpr {
namespace {

/// In the denominator of relative errors, so that black pixels do not count for all the others.
constexpr double kRelativeFloor = 1e-2;

/// Aovs that are means over the samples.
bool is_mean(Aov aov) {
  return is_part(aov) || aov == Aov::Albedo;
}

void add_to(ColorSum& sum, const Rgb& color, double weight) {
  sum.r += weight * static_cast<double>(color.r);
  sum.g += weight * static_cast<double>(color.g);
  sum.b += weight * static_cast<double>(color.b);
}

/// Negative weights can lift a mean past what a float holds.
float to_float(double value) {
  constexpr double kLargest = std::numeric_limits<float>::max();
  return static_cast<float>(std::clamp(value, -kLargest, kLargest));
}

double squared_error(double even, double odd, const std::array<double, 2>& weights) {
  const double half = 0.5 * (even / weights[0] - odd / weights[1]);
  const double mean = (even + odd) / (weights[0] + weights[1]);
  return half * half / (mean * mean + kRelativeFloor);
}

}  // namespace

Film::Film(const FrameLayout& layout, const FilmContent& content)
    : halves_{TileLayer<ColorSum>(layout), TileLayer<ColorSum>(layout)}, keeps_keys_(content.keys) {
  std::vector<Aov> first;
  for (const Aov aov : content.aovs) {
    if (is_mean(aov)) {
      means_.emplace(aov, layout);
    } else if (aov == Aov::Cost) {
      cost_ = TileLayer<double>(layout);
    } else if (needs_keys(aov)) {
      keeps_keys_ = true;
    } else {
      first.push_back(aov);
    }
  }
  first_ = AovLayers(layout, first);
  if (keeps_keys_) keys_ = TileLayer<Key>(layout);
}

void Film::set_counters(const Counters& counters) {
  samples_ = counters.samples;
  weights_ = counters.weights;
}

void Film::add_tile(const SampleLight& light, double weight, std::uint32_t number, std::size_t tile) {
  const auto sum_up = [&](TileLayer<ColorSum>& sums, const TileLayer<Rgb>& colors) {
    const std::span<const Rgb> from = colors.tile(tile);
    const std::span<ColorSum> to = sums.tile(tile);
    for (std::size_t i = 0; i < to.size(); ++i) add_to(to[i], from[i], weight);
    sums.set_active(tile);
  };
  sum_up(halves_[number % 2], light.radiance);
  for (auto& [aov, sums] : means_) sum_up(sums, light.aovs.rgb.at(aov));
  if (cost_.tiles() > 0) {
    const std::span<const float> from = light.aovs.single.at(Aov::Cost).tile(tile);
    const std::span<double> to = cost_.tile(tile);
    for (std::size_t i = 0; i < to.size(); ++i) to[i] += static_cast<double>(from[i]);
    cost_.set_active(tile);
  }
  if (number > 0) return;
  for (auto& [aov, layer] : first_.rgb) copy_tiles(light.aovs.rgb.at(aov), layer, {&tile, 1});
  for (auto& [aov, layer] : first_.single) copy_tiles(light.aovs.single.at(aov), layer, {&tile, 1});
  if (keeps_keys_) copy_tiles(light.keys, keys_, {&tile, 1});
}

void Film::add(std::span<const SampleLight> lights, std::span<const double> weights, std::span<const std::size_t> tiles,
               int threads) {
  HPR_CHECK(lights.size() == weights.size());
  for (const SampleLight& light : lights) HPR_CHECK(light.radiance.layout() == layout());
  // Tile by tile, as sums stay at hand.
  parallel_for(threads, tiles.size(), [&](std::size_t i) {
    for (std::size_t sample = 0; sample < lights.size(); ++sample) {
      add_tile(lights[sample], weights[sample], samples_ + static_cast<std::uint32_t>(sample), tiles[i]);
    }
  });
  for (const double weight : weights) weights_[samples_++ % 2] += weight;
}

void Film::resolve(std::span<const std::size_t> tiles, int threads, TileLayer<Rgb>& radiance, AovLayers& aovs) const {
  const double weights = weights_[0] + weights_[1];
  HPR_CHECK(weights != 0.0);
  const auto mean = [&](double sum) { return to_float(sum / weights); };
  parallel_for(threads, tiles.size(), [&](std::size_t i) {
    const std::size_t tile = tiles[i];
    const std::span<const ColorSum> even = halves_[0].tile(tile);
    const std::span<const ColorSum> odd = halves_[1].tile(tile);
    std::ranges::transform(even, odd, radiance.tile(tile).begin(), [&](const ColorSum& a, const ColorSum& b) {
      return Rgb{mean(a.r + b.r), mean(a.g + b.g), mean(a.b + b.b)};
    });
    radiance.set_active(tile);
    for (const auto& [aov, sums] : means_) {
      TileLayer<Rgb>& to = aovs.rgb.at(aov);
      std::ranges::transform(sums.tile(tile), to.tile(tile).begin(), [&](const ColorSum& sum) {
        return Rgb{mean(sum.r), mean(sum.g), mean(sum.b)};
      });
      to.set_active(tile);
    }
    if (cost_.tiles() > 0) {
      TileLayer<float>& to = aovs.single.at(Aov::Cost);
      std::ranges::transform(cost_.tile(tile), to.tile(tile).begin(),
                             [&](double sum) { return to_float(sum / static_cast<double>(samples_)); });
      to.set_active(tile);
    }
    for (const auto& [aov, layer] : first_.rgb) copy_tiles(layer, aovs.rgb.at(aov), {&tile, 1});
    for (const auto& [aov, layer] : first_.single) copy_tiles(layer, aovs.single.at(aov), {&tile, 1});
  });
}

std::vector<double> Film::squared_errors(std::span<const std::size_t> tiles, int threads) const {
  std::vector<double> errors(tiles.size(), 0.0);
  if (!(weights_[0] > 0.0) || !(weights_[1] > 0.0)) return errors;
  parallel_for(threads, tiles.size(), [&](std::size_t i) {
    const std::span<const ColorSum> even = halves_[0].tile(tiles[i]);
    const std::span<const ColorSum> odd = halves_[1].tile(tiles[i]);
    for (std::size_t pixel = 0; pixel < even.size(); ++pixel) {
      errors[i] += squared_error(even[pixel].r, odd[pixel].r, weights_) +
                   squared_error(even[pixel].g, odd[pixel].g, weights_) +
                   squared_error(even[pixel].b, odd[pixel].b, weights_);
    }
  });
  return errors;
}

double estimated_relmse(Communicator& comm, const Film& film, std::span<const std::size_t> tiles, int threads) {
  struct TileError {
    std::size_t tile;
    double error;
  };
  const std::vector<double> errors = film.squared_errors(tiles, threads);
  std::vector<TileError> mine;
  for (std::size_t i = 0; i < tiles.size(); ++i) mine.push_back({tiles[i], errors[i]});
  std::vector<TileError> all;
  for (const auto& bytes : all_gather(comm, std::as_bytes(std::span(mine)))) {
    const std::size_t before = all.size();
    all.resize(before + bytes.size() / sizeof(TileError));
    if (!bytes.empty()) std::memcpy(&all[before], bytes.data(), bytes.size());
  }
  std::ranges::sort(all, {}, &TileError::tile);  // one order of summing for any number of ranks
  double sum = 0.0;
  for (const TileError& each : all) sum += each.error;
  const std::size_t values = 3 * film.layout().pixels();
  return values == 0 ? 0.0 : sum / static_cast<double>(values);
}

}  // namespace hpr
