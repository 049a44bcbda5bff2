#include <algorithm>

#include "compositing/strategies/strategy.h"
#include "compositing/tile_codec.h"

namespace hpr {
namespace {

/// A binary tree with rank 0 at its root, as in Shaw, Green and Schaeffer, "A VLSI Architecture for Image Composition",
/// 1988: in round k the ranks that differ in bit k pair off, the higher one hands its layer down and is done.
///
/// Cost: ceil(log2 P) rounds of N keys. A rank sends at most one message; rank 0 receives one per round. Half of the
/// ranks that are left fall idle in each round, which binary swap avoids.
template <typename Pixel>
class Tree {
 public:
  [[nodiscard]] std::optional<Prediction> predict(const Costs& costs, const Load& load) const {
    double seconds = 0.0;
    for (int step = 1; step < load.ranks; step *= 2) {
      const double pairs = std::max(1.0, static_cast<double>(load.ranks) / (2.0 * step));
      seconds += costs.message + load.merged(step) * costs.byte(pairs);
    }
    return Prediction{seconds, false};
  }

  Composited run(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                 std::span<const int> /*shown_by*/) {
    const int rank = comm.rank();
    for (int step = 1; step < comm.size(); step *= 2) {
      if (rank % (2 * step) != 0) {
        sent_.send(comm, layer, tiles, rank - step);
        return {};
      }
      const int child = rank + step;
      if (child >= comm.size()) continue;
      merger_.exchange(comm, {}, {&child, 1}, layer, tiles);
    }
    return owning(tiles, {0, tiles.size()});
  }

 private:
  TileMessage sent_;
  PieceMerger<Pixel> merger_;
};

}  // namespace

Strategy tree_strategy() {
  return scheduled_strategy<Tree>("tree");
}

}  // namespace hpr
