#include "compositing/serial.h"

#include "compositing/tile_codec.h"

namespace hpr {

TileRun Serial::composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles) const {
  if (comm.rank() != 0) {
    comm.send(encode_tiles(layer, tiles), 0);
    return {};
  }
  for (int from = 1; from < comm.size(); ++from) merge_encoded(layer, tiles, comm.receive(from));
  return {0, tiles.size()};
}

}  // namespace hpr
