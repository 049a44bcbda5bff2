#include "compositing/tile_gather.h"

#include <algorithm>

#include "core/error.h"

namespace hpr {

std::vector<std::size_t> TileGather::composite(Communicator& comm, TileLayer<Key>& layer,
                                               std::span<const std::vector<std::size_t>> drawn,
                                               std::span<const int> owners) {
  const auto ranks = static_cast<std::size_t>(comm.size());
  const auto self = static_cast<std::size_t>(comm.rank());
  HPR_CHECK(drawn.size() == ranks && owners.size() == layer.tiles());
  std::vector<std::size_t> mine;
  for (std::size_t tile = 0; tile < owners.size(); ++tile) {
    if (owners[tile] == comm.rank()) mine.push_back(tile);
  }
  // What lies in a tile that this rank owns and does not draw by plan was drawn beside its parts; it is part of the
  // picture, and so of the maximum.
  std::vector<std::vector<std::size_t>> leaving(ranks);
  for (const std::size_t tile : drawn[self]) leaving[static_cast<std::size_t>(owners[tile])].push_back(tile);
  std::vector<std::vector<std::size_t>> arriving(ranks);
  std::vector<int> from;
  for (std::size_t rank = 0; rank < ranks; ++rank) {
    if (rank == self) continue;
    std::ranges::copy_if(drawn[rank], std::back_inserter(arriving[rank]),
                         [&](std::size_t tile) { return owners[tile] == comm.rank(); });
    if (!arriving[rank].empty()) from.push_back(static_cast<int>(rank));
  }
  messages_.resize(ranks);
  std::vector<Outgoing> out;
  for (std::size_t rank = 0; rank < ranks; ++rank) {
    if (rank == self || leaving[rank].empty()) continue;
    messages_[rank].start();
    messages_[rank].add(layer, leaving[rank]);
    out.push_back(messages_[rank].to(static_cast<int>(rank)));
  }
  comm.exchange(out, from, [&](int peer, std::span<const std::byte> message) {
    reader_.merge(comm, peer, message, layer, arriving[static_cast<std::size_t>(peer)]);
  });
  return mine;
}

}  // namespace hpr
