#include "compositing/strategies/ring.h"

#include "compositing/activity.h"

namespace hpr {

Composited Ring::composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                           std::span<const int> /*shown_by*/) {
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
    given_.start();
    given_.add(layer, piece(rank - step));
    const Outgoing out = given_.to(next);
    comm.exchange({&out, 1}, {&previous, 1}, [&](int from, std::span<const std::byte> message) {
      reader_.merge(comm, from, message, layer, piece(rank - step - 1));
    });
  }
  return owning(tiles, pieces[static_cast<std::size_t>(rank)]);
}

std::optional<Prediction> Ring::predict(const Costs& costs, const Load& load) const {
  double seconds = sharing_cost(costs);
  for (int step = 1; step < load.ranks; ++step) {
    seconds += costs.message + load.merged(step) / load.ranks * costs.swap_byte;
  }
  return Prediction{seconds};
}

}  // namespace hpr
