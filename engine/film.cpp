#include "engine/film.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "cluster/transport/collectives.h"
#include "core/error.h"
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
  constexpr double kMax = std::numeric_limits<float>::max();
  return static_cast<float>(std::clamp(value, -kMax, kMax));
}

double length2(const Rgb& color) {
  const auto square = [](float value) { return static_cast<double>(value) * static_cast<double>(value); };
  return square(color.r) + square(color.g) + square(color.b);
}

double squared_error(double even, double odd, const std::array<double, 2>& weights) {
  const double half = 0.5 * (even / weights[0] - odd / weights[1]);
  const double mean = (even + odd) / (weights[0] + weights[1]);
  return half * half / (mean * mean + kRelativeFloor);
}

}  // namespace

Film::Film(const FrameLayout& layout, const FilmContent& content)
    : halves_{TileLayer<ColorSum>(layout), TileLayer<ColorSum>(layout)},
      keeps_keys_(content.keys),
      pilot_(content.pilot) {
  std::vector<Aov> first;
  for (const Aov aov : content.aovs) {
    if (is_mean(aov)) {
      means_.emplace(aov, layout);
    } else if (aov == Aov::Cost) {
      cost_ = TileLayer<double>(layout);
    } else if (aov == Aov::Coverage) {
      coverage_ = TileLayer<double>(layout);
    } else if (needs_keys(aov)) {
      keeps_keys_ = true;
    } else {
      first.push_back(aov);
    }
  }
  first_ = AovLayers(layout, first);
  if (keeps_keys_) keys_ = TileLayer<Key>(layout);
  if (is_adaptive()) pixel_samples_ = TileLayer<PixelSamples>(layout);
}

void Film::set_counters(const Counters& counters) {
  samples_ = counters.samples;
  weights_ = counters.weights;
}

void Film::add_tile(const SampleLight& light, double weight, std::uint32_t number, std::size_t tile,
                    std::span<const std::uint16_t> due) {
  const auto each_due = [&](const auto& body) {
    if (is_adaptive()) {
      for (const std::uint16_t i : due) body(i);
    } else {
      for (std::size_t i = 0; i < kTilePixels; ++i) body(i);
    }
  };
  const auto sum_up = [&](TileLayer<ColorSum>& sums, const TileLayer<Rgb>& colors) {
    const std::span<const Rgb> from = colors.tile(tile);
    const std::span<ColorSum> to = sums.tile(tile);
    sums.touch(tile);
    each_due([&](std::size_t i) { add_to(to[i], from[i], weight); });
    sums.set_active(tile);
  };
  sum_up(halves_[number % 2], light.radiance);
  for (auto& [aov, sums] : means_) sum_up(sums, light.aovs.rgb.at(aov));
  const auto sum_single = [&](TileLayer<double>& sums, Aov aov, double factor) {
    if (sums.tiles() == 0) return;
    const std::span<const float> from = light.aovs.single.at(aov).tile(tile);
    const std::span<double> to = sums.tile(tile);
    sums.touch(tile);
    each_due([&](std::size_t i) { to[i] += factor * static_cast<double>(from[i]); });
    sums.set_active(tile);
  };
  sum_single(cost_, Aov::Cost, 1.0);
  sum_single(coverage_, Aov::Coverage, weight);
  if (is_adaptive()) {
    const std::span<const Rgb> from = light.radiance.tile(tile);
    const std::span<PixelSamples> pixels = pixel_samples_.tile(tile);
    each_due([&](std::size_t i) {
      pixels[i].weights[number % 2] += weight;
      pixels[i].squares += length2(from[i]);
      ++pixels[i].sample_count;
    });
    pixel_samples_.set_active(tile);
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
    if (is_adaptive()) pixel_samples_.touch(tiles[i]);
    const std::vector<std::uint16_t> due = due_pixels(tiles[i]);
    for (std::size_t sample = 0; sample < lights.size(); ++sample) {
      add_tile(lights[sample], weights[sample], samples_ + static_cast<std::uint32_t>(sample), tiles[i], due);
    }
  });
  for (const double weight : weights) weights_[samples_++ % 2] += weight;
}

void Film::resolve(std::span<const std::size_t> tiles, int threads, TileLayer<Rgb>& radiance, AovLayers& aovs) const {
  HPR_CHECK(weights_[0] + weights_[1] != 0.0);
  parallel_for(threads, tiles.size(), [&](std::size_t i) {
    const std::size_t tile = tiles[i];
    const auto each = [&](auto& layer, const auto& value) {
      const auto to = layer.tile(tile);
      for (std::size_t pixel = 0; pixel < to.size(); ++pixel) to[pixel] = value(pixel);
      layer.set_active(tile);
    };
    const auto mean = [&](std::size_t pixel, const ColorSum& sum) {
      const std::array<double, 2>& halves = weights_at(tile, pixel);
      const double weights = halves[0] + halves[1];
      return Rgb{to_float(sum.r / weights), to_float(sum.g / weights), to_float(sum.b / weights)};
    };
    const std::span<const ColorSum> even = halves_[0].tile(tile);
    const std::span<const ColorSum> odd = halves_[1].tile(tile);
    each(radiance, [&](std::size_t pixel) {
      const ColorSum& a = even[pixel];
      const ColorSum& b = odd[pixel];
      return mean(pixel, {a.r + b.r, a.g + b.g, a.b + b.b});
    });
    for (const auto& [aov, sums] : means_) {
      const std::span<const ColorSum> of_tile = sums.tile(tile);
      each(aovs.rgb.at(aov), [&](std::size_t pixel) { return mean(pixel, of_tile[pixel]); });
    }
    if (cost_.tiles() > 0) {
      each(aovs.single.at(Aov::Cost), [&](std::size_t pixel) {
        const std::uint32_t samples = is_adaptive() ? pixel_samples_.tile(tile)[pixel].sample_count : samples_;
        return to_float(cost_.tile(tile)[pixel] / static_cast<double>(samples));
      });
    }
    if (coverage_.tiles() > 0) {
      each(aovs.single.at(Aov::Coverage), [&](std::size_t pixel) {
        const std::array<double, 2>& halves = weights_at(tile, pixel);
        // Filters with negative weights overshoot.
        return to_float(std::clamp(coverage_.tile(tile)[pixel] / (halves[0] + halves[1]), 0.0, 1.0));
      });
    }
    for (const auto& [aov, layer] : first_.rgb) copy_tiles(layer, aovs.rgb.at(aov), {&tile, 1});
    for (const auto& [aov, layer] : first_.single) copy_tiles(layer, aovs.single.at(aov), {&tile, 1});
  });
}

std::vector<double> Film::squared_errors(std::span<const std::size_t> tiles, int threads) const {
  std::vector<double> errors(tiles.size(), 0.0);
  parallel_for(threads, tiles.size(), [&](std::size_t i) {
    const std::span<const ColorSum> even = halves_[0].tile(tiles[i]);
    const std::span<const ColorSum> odd = halves_[1].tile(tiles[i]);
    for (std::size_t pixel = 0; pixel < even.size(); ++pixel) {
      const std::array<double, 2>& weights = weights_at(tiles[i], pixel);
      if (!(weights[0] > 0.0) || !(weights[1] > 0.0)) continue;
      errors[i] += squared_error(even[pixel].r, odd[pixel].r, weights) +
                   squared_error(even[pixel].g, odd[pixel].g, weights) +
                   squared_error(even[pixel].b, odd[pixel].b, weights);
    }
  });
  return errors;
}

std::vector<std::uint16_t> Film::due_pixels(std::size_t tile) const {
  std::vector<std::uint16_t> due;
  if (!is_adaptive()) return due;
  const std::span<const PixelSamples> pixels = pixel_samples_.tile(tile);
  for (std::size_t i = 0; i < kTilePixels; ++i) {
    if (is_due(pixels[i])) due.push_back(static_cast<std::uint16_t>(i));
  }
  return due;
}

void Film::mark_due(std::span<const std::size_t> tiles, PixelMask& due) const {
  for (const std::size_t tile : tiles) {
    std::ranges::fill(due.tile(tile), std::uint8_t{0});
    for (const std::uint16_t pixel : due_pixels(tile)) due.tile(tile)[pixel] = 1;
    due.set_active(tile);
  }
}

std::vector<double> Film::variances(std::size_t tile) const {
  constexpr double kRounding = 1e-10;
  const std::span<const ColorSum> even = halves_[0].tile(tile);
  const std::span<const ColorSum> odd = halves_[1].tile(tile);
  std::vector<double> variances(kTilePixels, 0.0);
  for (std::size_t i = 0; i < kTilePixels; ++i) {
    const PixelSamples& pixel = pixel_samples_.tile(tile)[i];
    const double weights = pixel.weights[0] + pixel.weights[1];
    if (!(weights > 0.0)) continue;
    const ColorSum mean{(even[i].r + odd[i].r) / weights, (even[i].g + odd[i].g) / weights,
                        (even[i].b + odd[i].b) / weights};
    const double squared = mean.r * mean.r + mean.g * mean.g + mean.b * mean.b;
    // Where a filter with negative weights overshoots, the mean of squares may be the smaller one.
    const double variance = std::abs(pixel.squares / pixel.sample_count - squared);
    if (variance > kRounding * squared) variances[i] = variance / (squared / 3.0 + kRelativeFloor);
  }
  return variances;
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
  for (const auto& of_rank : all_gather_lists(comm, std::span<const TileError>(mine)))
    all.insert(all.end(), of_rank.begin(), of_rank.end());
  std::ranges::sort(all, {}, &TileError::tile);  // one order of summing for any number of ranks
  double sum = 0.0;
  for (const TileError& each : all) sum += each.error;
  const std::size_t values = 3 * film.layout().pixels();
  return values == 0 ? 0.0 : sum / static_cast<double>(values);
}

}  // namespace hpr
