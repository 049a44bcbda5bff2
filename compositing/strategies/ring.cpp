#include "compositing/activity.h"
#include "compositing/strategies/strategy.h"
#include "compositing/tile_codec.h"

namespace hpr {
namespace {

/// The frame is cut into P pieces, which travel once around the ring of ranks: in each of P - 1 steps a rank hands one
/// piece on to the next rank and merges its own pixels into the one that comes. Known as pipelined or ring compositing
/// (the master's thesis HPR grows out of has it with n - 1 steps), and as the reduce-scatter of ring all-reduce.
///
/// Cost: P - 1 messages and N (1 - 1/P) keys sent per rank, always to the same neighbour; P - 1 steps that wait for
/// each other.
class Ring final : public Compositor {
 public:
  [[nodiscard]] std::string_view name() const override { return "ring"; }

  [[nodiscard]] std::optional<Prediction> predict(const Costs& costs, const Load& load) const override {
    double seconds = sharing_cost(costs);
    for (int step = 1; step < load.ranks; ++step) {
      seconds += costs.message + load.merged(step) / load.ranks * costs.swap_byte;
    }
    return Prediction{seconds};
  }

  using Compositor::composite;
  Composited composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                       std::span<const int> /*shown_by*/) override {
    const int ranks = comm.size();
    const int rank = comm.rank();
    const std::vector<TileRun> pieces = share_activity(comm, layer, tiles).cut({0, tiles.size()}, ranks);
    // Piece r sets out from rank r + 1 and ends, with everyone's pixels in it, at rank r.
    const auto piece = [&](int number) {
      return part_of(tiles, pieces[static_cast<std::size_t>((number + 2 * ranks) % ranks)]);
    };
    const int next = (rank + 1) % ranks;
    const int previous = (rank + ranks - 1) % ranks;
    for (int step = 1; step < ranks; ++step) {
      sent_.start();
      sent_.add(layer, piece(rank - step));
      const Outgoing out = sent_.to(next);
      comm.exchange({&out, 1}, {&previous, 1}, [&](int from, std::span<const std::byte> message) {
        reader_.merge(comm, from, message, layer, piece(rank - step - 1));
      });
    }
    return owning(tiles, pieces[static_cast<std::size_t>(rank)]);
  }

 private:
  TileMessage sent_;
  TileReader reader_;
};

}  // namespace

Strategy ring_strategy() {
  return {"ring", make_implementation<Compositor, Ring>};
}

}  // namespace hpr
