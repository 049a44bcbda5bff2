#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "engine/aov.h"
#include "image/tiles.h"

namespace hpr {

class Communicator;

/// A sum of colours. Of floats of like size it is exact up to 2^29 of them; a million in any order lose less than a
/// float's rounding.
struct ColorSum {
  double r = 0.0;
  double g = 0.0;
  double b = 0.0;
};

/// One rendered sample that is added to a film.
struct SampleLight {
  const TileLayer<Rgb>& radiance;
  const AovLayers& aovs;
  const TileLayer<Key>& keys;
};

/// State of a pixel that may have another number of samples than its neighbours.
struct PixelSamples {
  std::array<double, 2> weights{};  ///< of the halves
  double squares = 0.0;             ///< sum of the colours' squared lengths
  std::uint32_t sample_count = 0;
  std::uint32_t wanted = 0;
};

/// Which layers a film keeps beside colours.
struct FilmContent {
  std::vector<Aov> aovs;
  bool keys = false;        ///< of the first sample
  std::uint32_t pilot = 0;  ///< adaptive: so many samples go to every pixel, further ones where they are wanted; 0: not
};

/// The samples of a frame, summed per pixel for the tiles of one rank, always in the order of their numbers: that, and
/// not who sums, decides the bits. Even and odd samples have sums of their own, whose difference estimates the noise. A
/// pixel's samples are the first so many of all numbers, in an adaptive film more for some pixels than for others.
class Film {
 public:
  Film(const FrameLayout& layout, const FilmContent& content);

  [[nodiscard]] const FrameLayout& layout() const { return halves_[0].layout(); }
  /// The number of the sample that is added next; of films that are not adaptive, how many were added.
  [[nodiscard]] std::uint32_t samples() const { return samples_; }
  [[nodiscard]] bool is_adaptive() const { return pilot_ > 0; }
  [[nodiscard]] std::uint32_t pilot() const { return pilot_; }
  /// Adaptive: sets the number of the sample that is added next.
  void set_next_sample(std::uint32_t number) { samples_ = number; }

  /// Adds samples of the numbers from samples() on, each with its weight, for `tiles`; in an adaptive film to the
  /// pixels that are due for the first of them, which are due for all.
  void add(std::span<const SampleLight> lights, std::span<const double> weights, std::span<const std::size_t> tiles,
           int threads);

  /// The means: weighted by their sum, which is not 0. Finite.
  void resolve(std::span<const std::size_t> tiles, int threads, TileLayer<Rgb>& radiance, AovLayers& aovs) const;

  /// Adaptive: sets `due` to 1 where sample number samples() is to be added, of `tiles`, and to 0 elsewhere in them.
  void mark_due(std::span<const std::size_t> tiles, PixelMask& due) const;
  /// Adaptive: per pixel of a tile the variance of its samples as relative errors weigh it, summed over the channels.
  /// 0 where all are the same but for rounding.
  [[nodiscard]] std::vector<double> variances(std::size_t tile) const;
  /// Adaptive: how many samples pixels have and want, row by row in tiles.
  [[nodiscard]] TileLayer<PixelSamples>& pixel_samples() { return pixel_samples_; }
  [[nodiscard]] const TileLayer<PixelSamples>& pixel_samples() const { return pixel_samples_; }

  /// Per tile of `tiles` the sum over its pixels and channels of the squared relative error of the mean, as the halves
  /// estimate it: (half their difference)^2 / (mean^2 + 0.01). Of rare bright samples it sees only those met so
  /// far, and their brightness excuses them. 0 before each half has a sum of weights above 0.
  [[nodiscard]] std::vector<double> squared_errors(std::span<const std::size_t> tiles, int threads) const;

  /// Keys of the first sample; a layer without tiles unless they are kept.
  [[nodiscard]] TileLayer<Key>& keys() { return keys_; }

  /// Calls `visit` with every layer of sums, in an order that depends on the content only: what a checkpoint holds
  /// beside the counters.
  template <typename Visitor>
  void each_layer(const Visitor& visit) {
    for (auto& half : halves_) visit(half);
    for (auto& [aov, layer] : means_) visit(layer);
    for (auto& [aov, layer] : first_.rgb) visit(layer);
    for (auto& [aov, layer] : first_.single) visit(layer);
    visit(cost_);
    visit(coverage_);
    visit(keys_);
    visit(pixel_samples_);
  }

  struct Counters {
    std::uint32_t samples = 0;
    std::array<double, 2> weights{};  ///< of the halves
  };
  [[nodiscard]] Counters counters() const { return {samples_, weights_}; }
  void set_counters(const Counters& counters);

 private:
  void add_tile(const SampleLight& light, double weight, std::uint32_t number, std::size_t tile,
                std::span<const std::uint16_t> due);
  [[nodiscard]] bool is_due(const PixelSamples& pixel) const {
    return pixel.sample_count == samples_ && samples_ < std::max(pixel.wanted, pilot_);
  }
  /// Adaptive: the pixels of a tile that are due for sample number samples().
  [[nodiscard]] std::vector<std::uint16_t> due_pixels(std::size_t tile) const;
  /// Sums of weights of both halves at a pixel.
  [[nodiscard]] const std::array<double, 2>& weights_at(std::size_t tile, std::size_t pixel) const {
    return is_adaptive() ? pixel_samples_.tile(tile)[pixel].weights : weights_;
  }

  std::array<TileLayer<ColorSum>, 2> halves_;
  std::map<Aov, TileLayer<ColorSum>> means_;
  TileLayer<double> cost_;
  TileLayer<double> coverage_;  ///< sums by weight
  AovLayers first_;
  TileLayer<Key> keys_;
  bool keeps_keys_ = false;
  TileLayer<PixelSamples> pixel_samples_;  ///< adaptive, else without tiles
  std::uint32_t pilot_ = 0;
  std::uint32_t samples_ = 0;
  std::array<double, 2> weights_{};
};

/// Collective: the film's estimate of the relative mean squared error over all pixels of the frame, the same on all
/// ranks and for any number of them. `tiles`: this rank's.
[[nodiscard]] double estimated_relmse(Communicator& comm, const Film& film, std::span<const std::size_t> tiles,
                                      int threads);

}  // namespace hpr
