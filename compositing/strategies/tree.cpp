#include "compositing/strategies/tree.h"

#include <algorithm>

namespace hpr {

template <typename Pixel>
Composited TreeSchedule<Pixel>::run(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                                    std::span<const int> /*shown_by*/) {
  const int rank = comm.rank();
  for (int step = 1; step < comm.size(); step *= 2) {
    if (rank % (2 * step) != 0) {
      given_.send(comm, layer, tiles, rank - step);
      return {};
    }
    const int child = rank + step;
    if (child >= comm.size()) continue;
    merger_.exchange(comm, {}, {&child, 1}, layer, tiles);
  }
  return owning(tiles, {0, tiles.size()});
}

template class TreeSchedule<Key>;
template class TreeSchedule<Rgba8Premultiplied>;
template class TreeSchedule<RgbaPremultiplied>;

Composited Tree::composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                           std::span<const int> shown_by) {
  return schedule_.run(comm, layer, tiles, shown_by);
}

std::optional<Prediction> Tree::predict(const Costs& costs, const Load& load) const {
  double seconds = 0.0;
  for (int step = 1; step < load.ranks; step *= 2) {
    const double pairs = std::max(1.0, static_cast<double>(load.ranks) / (2.0 * step));
    seconds += costs.message + load.merged(step) * costs.byte(pairs);
  }
  return Prediction{seconds, false};
}

}  // namespace hpr
