#include <algorithm>

#include "compositing/strategies/strategy.h"

namespace hpr {
namespace {

/// The maximum over all ranks by the communicator's own reduction (MPI_Ireduce with MPI_MAX under MPI) to rank 0. It
/// uses neither our merge kernel nor our tile codec, so it is an oracle for both.
///
/// Cost: what the MPI library makes of a reduction of N keys; empty tiles cost as much as full ones.
class MpiReduce final : public Compositor {
 public:
  [[nodiscard]] std::string_view name() const override { return "mpi-reduce"; }

  [[nodiscard]] std::optional<Prediction> predict(const Costs& costs, const Load& load) const override {
    return Prediction{costs.message + load.frame * costs.reduce_byte, false};
  }

  using Compositor::composite;
  Composited composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                       std::span<const int> /*shown_by*/) override {
    if (tiles.empty()) return {};
    const bool is_root = comm.rank() == 0;
    const std::size_t stretch = tiles.back() - tiles.front() + 1;
    std::vector<Key> packed;
    std::span<Key> values;
    if (stretch == tiles.size()) {
      values = layer.run({tiles.front(), stretch});
    } else {
      packed.reserve(tiles.size() * kTilePixels);
      for (const std::size_t tile : tiles) {
        const auto pixels = layer.tile(tile);
        packed.insert(packed.end(), pixels.begin(), pixels.end());
      }
      values = packed;
    }

    comm.reduce_max(values, 0);

    for (std::size_t i = 0; i < tiles.size(); ++i) {
      if (!is_root) {
        // A reduction may leave anything behind here; an active tile is one that gets cleared before it is used again.
        if (packed.empty()) layer.set_active(tiles[i]);
        continue;
      }
      const std::span<Key> tile = layer.tile(tiles[i]);
      if (!packed.empty()) std::ranges::copy(values.subspan(i * kTilePixels, kTilePixels), tile.begin());
      if (std::ranges::any_of(tile, [](Key key) { return key != kNoKey; })) layer.set_active(tiles[i]);
    }
    return is_root ? owning(tiles, {0, tiles.size()}) : Composited{};
  }
};

}  // namespace

Strategy mpi_reduce_strategy() {
  return {"mpi-reduce", make_implementation<Compositor, MpiReduce>};
}

}  // namespace hpr
