#pragma once

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "cluster/transport/communicator.h"
#include "compositing/tile_codec.h"
#include "image/tiles.h"

namespace hpr {

/// Who has a tile of a layer, and who is to get it.
struct TileMove {
  std::size_t tile = 0;
  int from = 0;
  int to = 0;
};

/// Collective, in one round of messages. Tiles of `source` come to `target`, which may be the same layer. `moves`: the
/// same on all ranks; those between two ranks in ascending order of tiles.
template <typename Pixel>
void move_tiles(Communicator& comm, std::span<const TileMove> moves, const TileLayer<Pixel>& source,
                TileLayer<Pixel>& target, TileReader& reader) {
  const auto ranks = static_cast<std::size_t>(comm.size());
  std::vector<std::vector<std::size_t>> leaving(ranks);
  std::vector<std::vector<std::size_t>> arriving(ranks);
  for (const TileMove& move : moves) {
    if (move.from == comm.rank()) leaving[static_cast<std::size_t>(move.to)].push_back(move.tile);
    if (move.to == comm.rank()) arriving[static_cast<std::size_t>(move.from)].push_back(move.tile);
  }
  std::vector<TileMessage> messages(ranks);
  std::vector<Outgoing> out;
  std::vector<int> from;
  for (int rank = 0; rank < comm.size(); ++rank) {
    const auto peer = static_cast<std::size_t>(rank);
    if (rank == comm.rank()) {
      if (&source != &target) copy_tiles(source, target, leaving[peer]);
      continue;
    }
    if (!arriving[peer].empty()) from.push_back(rank);
    if (leaving[peer].empty()) continue;
    messages[peer].start();
    messages[peer].add(source, leaving[peer]);
    out.push_back(messages[peer].to(rank));
  }
  comm.exchange(out, from, [&](int peer, std::span<const std::byte> message) {
    reader.replace(comm, peer, message, target, arriving[static_cast<std::size_t>(peer)]);
  });
}

/// Which rank keeps the sums of which tile. A sort-last strategy may leave a tile with another rank in every sample;
/// its keys then travel to the rank that had it in the first one, which lights it. Sums stay where they are, and each
/// is made by one rank in the order of the samples.
class TileOwnership {
 public:
  /// Collective. `owned`: this rank's tiles, ascending; this rank owns them from now on.
  TileOwnership(Communicator& comm, const FrameLayout& layout, std::span<const std::size_t> owned);

  /// Per tile its owner, or -1, as all ranks know them. This rank is `rank`.
  TileOwnership(std::vector<int> owners, int rank) : owner_(std::move(owners)) { mine_ = of(rank); }

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
    std::vector<TileMove> moves;
    for (int rank = 1; rank < comm.size(); ++rank) {
      for (const std::size_t tile : of(rank)) moves.push_back({tile, 0, rank});
    }
    move_tiles(comm, moves, layer, layer, reader_);
  }

 private:
  std::vector<std::size_t> mine_;
  std::vector<int> owner_;  ///< per tile the rank; -1: none
  TileReader reader_;
};

}  // namespace hpr
