#include "engine/tile_ownership.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <iterator>

#include "cluster/transport/collectives.h"

namespace hpr {
namespace {

std::vector<std::size_t> read_tiles(std::span<const std::byte> bytes) {
  std::vector<std::size_t> tiles(bytes.size() / sizeof(std::size_t));
  if (!tiles.empty()) std::memcpy(tiles.data(), bytes.data(), bytes.size());
  return tiles;
}

}  // namespace

TileOwnership::TileOwnership(Communicator& comm, const FrameLayout& layout, std::span<const std::size_t> owned)
    : mine_(owned.begin(), owned.end()), owner_(layout.tiles(), -1) {
  const auto all = all_gather(comm, std::as_bytes(owned));
  for (int rank = 0; rank < comm.size(); ++rank) {
    for (const std::size_t tile : read_tiles(all[static_cast<std::size_t>(rank)])) {
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
  // Every rank has the lists of all, so messages need no list of their own.
  const auto present_at = all_gather(comm, std::as_bytes(present));
  std::vector<TileMessage> messages(static_cast<std::size_t>(comm.size()));
  std::vector<Outgoing> out;
  std::vector<std::vector<std::size_t>> arriving(static_cast<std::size_t>(comm.size()));
  std::vector<int> from;
  for (int rank = 0; rank < comm.size(); ++rank) {
    if (rank == comm.rank()) continue;
    const auto peer = static_cast<std::size_t>(rank);
    std::vector<std::size_t> leaving;
    std::ranges::copy_if(present, std::back_inserter(leaving), [&](std::size_t tile) { return owner_[tile] == rank; });
    if (!leaving.empty()) {
      messages[peer].start();
      messages[peer].add(layer, leaving);
      out.push_back(messages[peer].to(rank));
    }
    std::ranges::copy_if(read_tiles(present_at[peer]), std::back_inserter(arriving[peer]),
                         [&](std::size_t tile) { return owner_[tile] == comm.rank(); });
    if (!arriving[peer].empty()) from.push_back(rank);
  }
  comm.exchange(out, from, [&](int peer, std::span<const std::byte> message) {
    reader_.replace(comm, peer, message, layer, arriving[static_cast<std::size_t>(peer)]);
  });
}

}  // namespace hpr
