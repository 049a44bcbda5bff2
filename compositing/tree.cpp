#include "compositing/tree.h"

#include "compositing/tile_codec.h"

namespace hpr {

TileRun Tree::composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles) const {
  const int rank = comm.rank();
  for (int step = 1; step < comm.size(); step *= 2) {
    if (rank % (2 * step) != 0) {
      comm.send(encode_tiles(layer, tiles), rank - step);
      return {};
    }
    if (rank + step < comm.size()) merge_encoded(layer, tiles, comm.receive(rank + step));
  }
  return {0, tiles.size()};
}

}  // namespace hpr
