#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "cluster/communicator.h"
#include "image/tiles.h"

namespace hpr {

/// Which rank has drawn into which tiles of a list: what it takes to share the work of merging by what there is to
/// merge, and to send nothing where there is nothing.
class Activity {
 public:
  /// `bits`: per rank one bit per tile of the list, the lowest first, in whole words.
  Activity(int ranks, std::size_t tiles, std::vector<std::uint64_t> bits);

  [[nodiscard]] int ranks() const { return ranks_; }
  [[nodiscard]] std::size_t tiles() const { return weights_.size(); }
  [[nodiscard]] bool active(int rank, std::size_t position) const {
    return (word(rank, position / 64) >> (position % 64) & 1U) != 0;
  }
  /// Ranks that have drawn into a tile of the list.
  [[nodiscard]] std::uint32_t weight(std::size_t position) const { return weights_[position]; }

  /// Cuts a run of the list into `parts` runs of as equal weight as whole tiles allow, empty tiles counting a little,
  /// so that lists nobody drew into are cut evenly. The same on every rank.
  [[nodiscard]] std::vector<TileRun> cut(TileRun run, int parts) const;

 private:
  [[nodiscard]] std::uint64_t word(int rank, std::size_t index) const {
    return bits_[static_cast<std::size_t>(rank) * words_ + index];
  }

  int ranks_;
  std::size_t words_;  ///< per rank
  std::vector<std::uint64_t> bits_;
  std::vector<std::uint32_t> weights_;  ///< per tile of the list
};

/// One bit per tile of a list, the lowest first, in whole words: has `layer` anything there?
template <typename Pixel>
[[nodiscard]] std::vector<std::uint64_t> active_bits(const TileLayer<Pixel>& layer,
                                                     std::span<const std::size_t> tiles) {
  std::vector<std::uint64_t> bits((tiles.size() + 63) / 64);
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    if (layer.active(tiles[i])) bits[i / 64] |= std::uint64_t{1} << (i % 64);
  }
  return bits;
}

/// Collective: the bits of a list of `tiles` tiles of every rank, gathered in ceil(log2 P) rounds.
[[nodiscard]] Activity share_activity(Communicator& comm, std::span<const std::uint64_t> bits, std::size_t tiles);
template <typename Pixel>
[[nodiscard]] Activity share_activity(Communicator& comm, const TileLayer<Pixel>& layer,
                                      std::span<const std::size_t> tiles) {
  return share_activity(comm, active_bits(layer, tiles), tiles.size());
}

}  // namespace hpr
