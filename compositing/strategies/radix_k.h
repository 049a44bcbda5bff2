#pragma once

#include "compositing/compositor.h"
#include "compositing/strategies/swap_rounds.h"

namespace hpr {

/// "4,2". Throws Error (Usage) when it is not a list of factors of 2 or more.
[[nodiscard]] std::vector<int> parse_radix_factors(std::string_view list);

/// The messages of radix-k, for any kind of pixel.
template <typename Pixel>
class RadixKSchedule {
 public:
  /// Factors chosen for the number of ranks, or given ones.
  RadixKSchedule() = default;
  explicit RadixKSchedule(std::vector<int> factors) : factors_(std::move(factors)) {}

  [[nodiscard]] bool fits(int ranks) const;
  /// What is used for so many ranks.
  [[nodiscard]] std::vector<int> factors(int ranks) const;
  Composited run(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                 std::span<const int> shown_by);

 private:
  std::vector<int> factors_;
  SwapRounds<Pixel> rounds_;
};

/// In round i groups of k_i ranks swap parts of the run they share, each rank sending k_i - 1 of them, where
/// k_1 k_2 ... = P: binary swap for all twos, direct send for the one factor P. Peterka, Goodell, Ross, Shen and
/// Thakur, "A Configurable Algorithm for Parallel Image-Compositing Applications", 2009.
///
/// Cost: sum of (k_i - 1) messages and N (1 - 1/P) keys sent per rank, after the same ceil(log2 P) messages of a bit
/// per tile as binary swap's.
class RadixK final : public Compositor {
 public:
  /// Factors chosen for the number of ranks: as few rounds as groups of at most 8 allow.
  RadixK() = default;
  /// "4,2": fits 8 ranks only. Throws Error (Usage) when it is not a list of factors of 2 or more.
  explicit RadixK(std::string_view factors);

  [[nodiscard]] std::string_view name() const override { return name_; }
  [[nodiscard]] bool fits(int ranks) const override { return schedule_.fits(ranks); }
  using Compositor::composite;
  Composited composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                       std::span<const int> shown_by) override;
  [[nodiscard]] std::optional<Prediction> predict(const Costs& costs, const Load& load) const override;

  /// What is chosen for so many ranks, the largest first: prime factors, joined while a product stays at 8 or below.
  [[nodiscard]] static std::vector<int> factors_for(int ranks);

 private:
  std::string name_ = "radix-k";
  RadixKSchedule<Key> schedule_;
};

}  // namespace hpr
