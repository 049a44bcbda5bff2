#include <numeric>

#include "compositing/strategies/strategy.h"
#include "compositing/tile_codec.h"

namespace hpr {
namespace {

/// Every rank sends its layer to rank 0, which merges them as they come: the floor any other strategy must beat.
/// Known as direct send to one rank, and as the naive sort-last of Molnar, Cox, Ellsworth and Fuchs, "A Sorting
/// Classification of Parallel Rendering", 1994.
///
/// Cost: rank 0 receives and merges (P - 1) N keys one after the other; the others send one message of N keys.
template <typename Pixel>
class Serial {
 public:
  [[nodiscard]] std::optional<Prediction> predict(const Costs& costs, const Load& load) const {
    return Prediction{costs.message + (load.ranks - 1) * load.mean_layer * costs.pull_byte, false};
  }

  Composited run(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                 std::span<const int> /*shown_by*/) {
    if (comm.rank() != 0) {
      sent_.send(comm, layer, tiles, 0);
      return {};
    }
    std::vector<int> others(static_cast<std::size_t>(comm.size()) - 1);
    std::iota(others.begin(), others.end(), 1);
    merger_.exchange(comm, {}, others, layer, tiles);
    return owning(tiles, {0, tiles.size()});
  }

 private:
  TileMessage sent_;
  PieceMerger<Pixel> merger_;
};

}  // namespace

Strategy serial_strategy() {
  return scheduled_strategy<Serial>("serial");
}

}  // namespace hpr
