#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "cluster/transport/communicator.h"
#include "compositing/tile_codec.h"
#include "image/key.h"
#include "image/tiles.h"

namespace hpr {

/// Composites layers where it is known beforehand which ranks may draw into a tile, and who is to own it: only those
/// ranks meet in it. One round of messages between ranks that have tiles in common, and no other.
class TileGather {
 public:
  /// Collective. `drawn`: per rank the tiles that it may draw into, ascending; `owners`: per tile of the frame the rank
  /// that owns it. Both the same on all ranks. Returns this rank's tiles, ascending; only those of `layer` hold the
  /// result, others are scratch.
  [[nodiscard]] std::vector<std::size_t> composite(Communicator& comm, TileLayer<Key>& layer,
                                                   std::span<const std::vector<std::size_t>> drawn,
                                                   std::span<const int> owners);

 private:
  std::vector<TileMessage> messages_;  ///< per rank
  TileReader reader_;
};

}  // namespace hpr
