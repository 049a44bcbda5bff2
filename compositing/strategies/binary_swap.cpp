#include <bit>

#include "compositing/strategies/radix_k.h"
#include "compositing/strategies/strategy.h"

namespace hpr {
namespace {

/// Ranks paired off until a power of two is left: of ranks 2i and 2i + 1, i < pairs, only the even one stays a member.
class Fold {
 public:
  explicit Fold(int ranks)
      : members_(static_cast<int>(std::bit_floor(static_cast<unsigned>(ranks)))), pairs_(ranks - members_) {}

  [[nodiscard]] int members() const { return members_; }
  /// The factors of the rounds.
  [[nodiscard]] std::vector<int> twos() const {
    std::vector<int> factors(static_cast<std::size_t>(rounds_of(members_)), 2);
    return factors;
  }
  [[nodiscard]] bool paired(int rank) const { return rank < 2 * pairs_; }
  [[nodiscard]] int member_of(int rank) const { return paired(rank) ? rank / 2 : rank - pairs_; }
  [[nodiscard]] int rank_of(int member) const { return member < pairs_ ? 2 * member : member + pairs_; }

 private:
  int members_;
  int pairs_;
};

/// In each round two ranks swap halves of the run they share, until every rank owns a part of the frame. Ma, Painter,
/// Hansen and Krogh, "Parallel Volume Rendering Using Binary-Swap Compositing", 1994.
///
/// Ranks past the largest power of two first give their whole layer to a neighbour and own nothing after (fold): one
/// message more, where telescoping (Moreland, 2011) would keep them busy at the price of unequal pieces.
///
/// Cost: log2 P rounds; a rank sends N (1 - 1/P) keys, N the frame's. Before them one bit per tile and rank, in
/// ceil(log2 P) messages, by which the halves are cut to hold as much to merge each.
template <typename Pixel>
class BinarySwap {
 public:
  [[nodiscard]] std::optional<Prediction> predict(const Costs& costs, const Load& load) const {
    const Fold fold(load.ranks);
    double seconds = sharing_cost(costs);
    const int folded = load.ranks - fold.members();
    if (folded > 0) seconds += costs.message + load.mean_layer * costs.byte(folded);
    return Prediction{seconds +
                      swap_rounds_cost(costs, load, fold.twos(), static_cast<double>(load.ranks) / fold.members())};
  }

  Composited run(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                 std::span<const int> /*shown_by*/) {
    const Fold fold(comm.size());
    const int rank = comm.rank();
    const Activity activity = share_activity(comm, layer, tiles);
    if (fold.paired(rank)) {
      if (rank % 2 == 1) {
        folded_.send(comm, layer, tiles, rank - 1);
        return {};
      }
      const int neighbour = rank + 1;
      merger_.exchange(comm, {}, {&neighbour, 1}, layer, tiles);
    }
    const TileRun mine = rounds_.run(comm, layer, tiles, activity, fold.twos(), fold.member_of(rank),
                                     [&](int member) { return fold.rank_of(member); });
    return owning(tiles, mine);
  }

 private:
  SwapRounds<Pixel> rounds_;
  TileMessage folded_;
  PieceMerger<Pixel> merger_;
};

}  // namespace

Strategy binary_swap_strategy() {
  return scheduled_strategy<BinarySwap>("binary-swap");
}

}  // namespace hpr
