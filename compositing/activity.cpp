#include "compositing/activity.h"

#include "cluster/transport/collectives.h"
#include "core/error.h"

namespace hpr {
namespace {

// What a tile costs a strategy, about: being looked at; being announced and set up, if anything was drawn; its pixels.
constexpr std::uint64_t kReadCost = 1;
constexpr std::uint64_t kActiveCost = 4;
constexpr std::uint64_t kFillCost = 4;

}  // namespace

Activity::Activity(int ranks, std::size_t tiles, std::vector<std::uint64_t> fills)
    : ranks_(ranks),
      words_((tiles + kTilesAWord - 1) / kTilesAWord),
      fills_(std::move(fills)),
      weights_(tiles),
      costs_(tiles, kReadCost) {
  HPR_CHECK(fills_.size() == words_ * static_cast<std::size_t>(ranks));
  for (int rank = 0; rank < ranks; ++rank) {
    for (std::size_t position = 0; position < tiles; ++position) {
      const std::uint64_t filled = fill(rank, position);
      if (filled == 0) continue;
      ++weights_[position];
      costs_[position] += kActiveCost + kFillCost * filled;
    }
  }
}

std::vector<TileRun> Activity::cut(TileRun run, int parts) const {
  std::uint64_t all = 0;
  for (std::size_t position = run.first; position < run.end(); ++position) all += costs_[position];

  std::vector<TileRun> runs;
  std::size_t next = run.first;
  std::uint64_t before = 0;
  for (int part = 1; part <= parts; ++part) {
    const std::size_t first = next;
    const std::uint64_t goal = all * static_cast<std::uint64_t>(part) / static_cast<std::uint64_t>(parts);
    // A tile goes to the part in which most of it lies; no cost is 0, so the last part takes all that is left.
    while (next < run.end() && before + costs_[next] / 2 < goal) before += costs_[next++];
    runs.push_back({first, next - first});
  }
  return runs;
}

Activity share_activity(Communicator& comm, std::span<const std::uint64_t> fills, std::size_t tiles) {
  // A bit per tile, and four more per tile that holds anything: empty tiles cost a bit.
  const auto fill_in = [&](std::span<const std::uint64_t> words, std::size_t tile) {
    return words[tile / Activity::kTilesAWord] >> (4 * (tile % Activity::kTilesAWord)) & kFullTile;
  };
  std::vector<std::byte> own((tiles + 7) / 8);
  std::vector<std::byte> halves;
  std::size_t drawn = 0;
  for (std::size_t tile = 0; tile < tiles; ++tile) {
    const std::uint64_t fill = fill_in(fills, tile);
    if (fill == 0) continue;
    own[tile / 8] |= std::byte{1} << (tile % 8);
    if (drawn % 2 == 0) halves.emplace_back();
    halves.back() |= static_cast<std::byte>(fill) << (4 * (drawn % 2));
    ++drawn;
  }
  own.insert(own.end(), halves.begin(), halves.end());

  std::vector<std::uint64_t> all;
  all.reserve(fills.size() * static_cast<std::size_t>(comm.size()));
  for (const std::vector<std::byte>& part : all_gather(comm, own)) {
    std::vector<std::uint64_t> words(fills.size());
    std::size_t next = 2 * ((tiles + 7) / 8);  // in halves of bytes
    for (std::size_t tile = 0; tile < tiles; ++tile) {
      if ((part.at(tile / 8) >> (tile % 8) & std::byte{1}) == std::byte{0}) continue;
      const auto fill = static_cast<std::uint64_t>(part.at(next / 2) >> (4 * (next % 2)) & std::byte{0xF});
      words[tile / Activity::kTilesAWord] |= fill << (4 * (tile % Activity::kTilesAWord));
      ++next;
    }
    all.insert(all.end(), words.begin(), words.end());
  }
  return {comm.size(), tiles, std::move(all)};
}

}  // namespace hpr
