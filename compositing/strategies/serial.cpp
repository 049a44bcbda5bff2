#include "compositing/strategies/serial.h"

#include <numeric>

namespace hpr {

template <typename Pixel>
Composited SerialSchedule<Pixel>::run(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                                      std::span<const int> /*shown_by*/) {
  if (comm.rank() != 0) {
    given_.send(comm, layer, tiles, 0);
    return {};
  }
  std::vector<int> others(static_cast<std::size_t>(comm.size()) - 1);
  std::iota(others.begin(), others.end(), 1);
  merger_.exchange(comm, {}, others, layer, tiles);
  return owning(tiles, {0, tiles.size()});
}

template class SerialSchedule<Key>;
template class SerialSchedule<Rgba8Premultiplied>;
template class SerialSchedule<RgbaPremultiplied>;

Composited Serial::composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                             std::span<const int> shown_by) {
  return schedule_.run(comm, layer, tiles, shown_by);
}

std::optional<Prediction> Serial::predict(const Costs& costs, const Load& load) const {
  return Prediction{costs.message + (load.ranks - 1) * load.mean_layer * costs.pull_byte, false};
}

}  // namespace hpr
