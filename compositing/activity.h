#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "cluster/transport/communicator.h"
#include "compositing/kernels.h"
#include "image/tiles.h"

namespace hpr {

/// How full a tile is, in fifteenths rounded up: 0 where nothing was drawn.
inline constexpr std::uint64_t kFullTile = 15;

/// Which rank has drawn how much into which tiles of a list: what it takes to share the work of merging by what there
/// is to merge, and to send nothing where there is nothing.
class Activity {
 public:
  /// `fills`: per rank four bits per tile of the list, the lowest first, in whole words (see tile_fills).
  Activity(int ranks, std::size_t tiles, std::vector<std::uint64_t> fills);

  [[nodiscard]] int ranks() const { return ranks_; }
  [[nodiscard]] std::size_t tiles() const { return weights_.size(); }
  [[nodiscard]] bool active(int rank, std::size_t position) const { return fill(rank, position) != 0; }
  /// Ranks that have drawn into a tile of the list.
  [[nodiscard]] std::uint32_t weight(std::size_t position) const { return weights_[position]; }

  /// Cuts a run of the list into `parts` runs of as equal work as whole tiles allow. A tile costs by the pixels drawn
  /// into it, and a constant for being read, so that lists nobody drew into are cut evenly. The same on every rank.
  [[nodiscard]] std::vector<TileRun> cut(TileRun run, int parts) const;

  static constexpr std::size_t kTilesAWord = 16;

 private:
  [[nodiscard]] std::uint64_t fill(int rank, std::size_t position) const {
    const std::uint64_t word = fills_[static_cast<std::size_t>(rank) * words_ + position / kTilesAWord];
    return word >> (4 * (position % kTilesAWord)) & kFullTile;
  }

  int ranks_;
  std::size_t words_;  ///< per rank
  std::vector<std::uint64_t> fills_;
  std::vector<std::uint32_t> weights_;  ///< per tile of the list
  std::vector<std::uint64_t> costs_;    ///< per tile of the list
};

/// Four bits per tile of a list, the lowest first, in whole words: how much `layer` holds there. Where work is not
/// shared by it, `counts` false says only whether it holds anything.
template <typename Pixel>
[[nodiscard]] std::vector<std::uint64_t> tile_fills(const TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                                                    bool counts = true) {
  constexpr std::size_t kTiles = Activity::kTilesAWord;
  std::vector<std::uint64_t> fills((tiles.size() + kTiles - 1) / kTiles);
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    if (!layer.active(tiles[i])) continue;
    // A thin shape may be missed, which costs balance and nothing else.
    const double fraction = counts ? sampled_fraction<Pixel>(layer.tile(tiles[i])) : 1.0;
    const auto fill = 1 + static_cast<std::uint64_t>(fraction * static_cast<double>(kFullTile - 1));
    fills[i / kTiles] |= fill << (4 * (i % kTiles));
  }
  return fills;
}

/// Collective: the fills of a list of `tiles` tiles of every rank, gathered in ceil(log2 P) rounds.
[[nodiscard]] Activity share_activity(Communicator& comm, std::span<const std::uint64_t> fills, std::size_t tiles);
template <typename Pixel>
[[nodiscard]] Activity share_activity(Communicator& comm, const TileLayer<Pixel>& layer,
                                      std::span<const std::size_t> tiles) {
  return share_activity(comm, tile_fills(layer, tiles), tiles.size());
}

}  // namespace hpr
