#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "compositing/activity.h"
#include "compositing/compositor.h"
#include "compositing/tile_codec.h"

namespace hpr {

/// Rounds in which groups of k members swap parts of the run they share until every member owns a part of its own: what
/// binary swap (k = 2) and radix-k have in common.
template <typename Pixel>
class SwapRounds {
 public:
  /// Members 0 .. product of `factors` - 1 take part, one factor a round; this rank is `member`, and rank_of(m) is the
  /// rank of member m. In each round the members of a group differ in one digit of their numbers and so hold the same
  /// run of `tiles`; they cut it alike, by what all ranks have drawn there. Returns the run this member ends up with.
  ///
  /// Where rank_of ascends, members merge what neighbours in rank hold: the groups of the first round are neighbours,
  /// those of each next one are neighbouring groups.
  TileRun run(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles, const Activity& activity,
              std::span<const int> factors, int member, const std::function<int(int)>& rank_of);

 private:
  std::vector<TileMessage> sent_;  ///< per other member of the group
  PieceMerger<Pixel> merger_;
};

/// The factors radix-k chooses for a number of ranks, the largest first: prime factors, joined while a product stays at
/// 8 or below.
[[nodiscard]] std::vector<int> radix_factors(int ranks);

/// In round i groups of k_i ranks swap parts of the run they share, each rank sending k_i - 1 of them, where
/// k_1 k_2 ... = P: binary swap for all twos, direct send for the one factor P. Peterka, Goodell, Ross, Shen and
/// Thakur, "A Configurable Algorithm for Parallel Image-Compositing Applications", 2009.
///
/// Cost: sum of (k_i - 1) messages and N (1 - 1/P) keys sent per rank, after the same ceil(log2 P) messages of a bit
/// per tile as binary swap's.
template <typename Pixel>
class RadixK {
 public:
  /// Chooses the factors for the number of ranks.
  RadixK() = default;
  /// "radix-k", or "radix-k:4,2", which fits 8 ranks only. Throws Error (Usage) when what follows the colon is not a
  /// list of factors of 2 or more.
  explicit RadixK(std::string_view written_name);

  [[nodiscard]] bool fits(int ranks) const;
  [[nodiscard]] std::optional<Prediction> predict(const Costs& costs, const Load& load) const;
  Composited run(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                 std::span<const int> shown_by);

 private:
  [[nodiscard]] std::vector<int> factors(int ranks) const { return factors_.empty() ? radix_factors(ranks) : factors_; }

  std::vector<int> factors_;
  SwapRounds<Pixel> rounds_;
};

}  // namespace hpr
