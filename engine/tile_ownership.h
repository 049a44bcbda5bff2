#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "cluster/transport/communicator.h"
#include "compositing/tile_codec.h"
#include "image/tiles.h"

namespace hpr {

/// Which rank keeps the sums of which tile. A sort-last strategy may leave a tile with another rank in every sample;
/// its keys then travel to the rank that had it in the first one, which lights it. Sums stay where they are, and each
/// is made by one rank in the order of the samples.
class TileOwnership {
 public:
  /// Collective. `owned`: this rank's tiles, ascending; this rank owns them from now on.
  TileOwnership(Communicator& comm, const FrameLayout& layout, std::span<const std::size_t> owned);

  /// This rank's, ascending.
  [[nodiscard]] const std::vector<std::size_t>& mine() const { return mine_; }
  /// Of any rank, ascending.
  [[nodiscard]] std::vector<std::size_t> of(int rank) const;

  /// Collective over `comm`. `present`: the tiles whose keys this rank has in `layer`, which together with the other
  /// ranks' are those of the constructor. Sends each to its owner; then `layer` holds the tiles of mine(). One round of
  /// messages where any rank has a tile of another one, else only the round that finds that out.
  void move_to_owners(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> present);

  /// Collective over `comm`. `layer` of rank 0 holds all tiles; after it every rank has its own of them.
  template <typename Pixel>
  void scatter(Communicator& comm, TileLayer<Pixel>& layer) {
    if (comm.rank() != 0) {
      comm.exchange({}, std::vector<int>{0}, [&](int from, std::span<const std::byte> message) {
        reader_.replace(comm, from, message, layer, mine_);
      });
      return;
    }
    std::vector<TileMessage> messages(static_cast<std::size_t>(comm.size()));
    std::vector<Outgoing> out;
    for (int rank = 1; rank < comm.size(); ++rank) {
      TileMessage& message = messages[static_cast<std::size_t>(rank)];
      message.start();
      message.add(layer, of(rank));
      out.push_back(message.to(rank));
    }
    comm.exchange(out, {}, {});
  }

 private:
  std::vector<std::size_t> mine_;
  std::vector<int> owner_;  ///< per tile the rank; -1: none
  TileReader reader_;
};

}  // namespace hpr
