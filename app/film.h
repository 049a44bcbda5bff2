#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "app/aov.h"
#include "cluster/communicator.h"
#include "image/tiles.h"
#include "rt/lighter.h"

namespace hpr {

/// A sum of colours. Of floats of like size it is exact up to 2^29 of them; a million in any order lose less than a
/// float's rounding.
struct ColorSum {
  double r = 0.0;
  double g = 0.0;
  double b = 0.0;
};

/// What a film learns of one sample.
struct SampleLight {
  const TileLayer<Rgb>& radiance;
  const AovLayers& aovs;
  const TileLayer<Key>& keys;
};

/// Which layers a film keeps beside colours.
struct FilmContent {
  std::vector<Aov> aovs;
  bool keys = false;  ///< of the first sample
};

/// The samples of a frame, summed per pixel for the tiles of one rank, always in the order of their numbers: that, and
/// not who sums, decides the bits. Even and odd samples have sums of their own, whose difference tells the noise.
class Film {
 public:
  Film(const FrameLayout& layout, const FilmContent& content);

  [[nodiscard]] const FrameLayout& layout() const { return halves_[0].layout(); }
  /// How many were added.
  [[nodiscard]] std::uint32_t samples() const { return samples_; }

  /// Adds samples of the numbers from samples() on, each with its weight, for `tiles`.
  void add(std::span<const SampleLight> lights, std::span<const double> weights, std::span<const std::size_t> tiles,
           int threads);

  /// The means: weighted by their sum, which is not 0. Finite.
  void resolve(std::span<const std::size_t> tiles, int threads, TileLayer<Rgb>& radiance, AovLayers& aovs) const;

  /// Per tile of `tiles` the sum over its pixels and channels of the squared relative error of the mean, as the halves
  /// tell it: (half their difference)^2 / (mean^2 + 0.01). A guess: of rare bright samples it sees only those met so
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
    visit(keys_);
  }

  struct Counters {
    std::uint32_t samples = 0;
    std::array<double, 2> weights{};  ///< of the halves
  };
  [[nodiscard]] Counters counters() const { return {samples_, weights_}; }
  void set_counters(const Counters& counters);

 private:
  void add_tile(const SampleLight& light, double weight, std::uint32_t number, std::size_t tile);

  std::array<TileLayer<ColorSum>, 2> halves_;
  std::map<Aov, TileLayer<ColorSum>> means_;
  TileLayer<double> cost_;
  AovLayers first_;
  TileLayer<Key> keys_;
  bool keeps_keys_ = false;
  std::uint32_t samples_ = 0;
  std::array<double, 2> weights_{};
};

/// Collective: the film's estimate of the relative mean squared error over all pixels of the frame, the same on all
/// ranks and for any number of them. `tiles`: this rank's.
[[nodiscard]] double estimated_relmse(Communicator& comm, const Film& film, std::span<const std::size_t> tiles,
                                      int threads);

}  // namespace hpr
