#include "engine/tile_ownership.h"

#include <algorithm>
#include <cstdint>

#include "cluster/transport/collectives.h"

namespace hpr {
TileOwnership::TileOwnership(Communicator& comm, const FrameLayout& layout, std::span<const std::size_t> owned)
    : mine_(owned.begin(), owned.end()), owner_(layout.tiles(), -1) {
  const auto all = all_gather_lists(comm, owned);
  for (int rank = 0; rank < comm.size(); ++rank) {
    for (const std::size_t tile : all[static_cast<std::size_t>(rank)]) {
      HPR_CHECK(owner_.at(tile) == -1);
      owner_[tile] = rank;
    }
  }
}

std::vector<std::size_t> TileOwnership::of(int rank) const {
  std::vector<std::size_t> tiles;
  for (std::size_t tile = 0; tile < owner_.size(); ++tile) {
    if (owner_[tile] == rank) tiles.push_back(tile);
  }
  return tiles;
}

void TileOwnership::move_to_owners(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> present) {
  const std::uint8_t moved = std::ranges::equal(present, mine_) ? 0 : 1;
  if (std::ranges::none_of(all_gather_value(comm, moved), [](std::uint8_t any) { return any != 0; })) return;
  const auto present_at = all_gather_lists(comm, present);
  std::vector<TileMove> moves;
  for (int rank = 0; rank < comm.size(); ++rank) {
    for (const std::size_t tile : present_at[static_cast<std::size_t>(rank)]) {
      if (owner_[tile] != rank) moves.push_back({tile, rank, owner_[tile]});
    }
  }
  move_tiles(comm, moves, layer, layer, reader_);
}

}  // namespace hpr
