#include "compositing/activity.h"

#include <bit>
#include <cstring>

#include "cluster/collectives.h"
#include "core/check.h"

namespace hpr {
namespace {

constexpr std::size_t kWordBits = 64;
/// What an active tile weighs against an empty one, which is only looked at.
constexpr std::uint64_t kActiveWeight = 64;

}  // namespace

Activity::Activity(int ranks, std::size_t tiles, std::vector<std::uint64_t> bits)
    : ranks_(ranks), words_((tiles + kWordBits - 1) / kWordBits), bits_(std::move(bits)), weights_(tiles) {
  HPR_CHECK(bits_.size() == words_ * static_cast<std::size_t>(ranks));
  for (int rank = 0; rank < ranks; ++rank) {
    for (std::size_t i = 0; i < words_; ++i) {
      for (std::uint64_t rest = word(rank, i); rest != 0; rest &= rest - 1) {
        const std::size_t position = i * kWordBits + static_cast<std::size_t>(std::countr_zero(rest));
        HPR_CHECK(position < tiles);
        ++weights_[position];
      }
    }
  }
}

std::vector<TileRun> Activity::cut(TileRun run, int parts) const {
  const auto cost = [&](std::size_t position) { return 1 + kActiveWeight * weights_[position]; };
  std::uint64_t all = 0;
  for (std::size_t position = run.first; position < run.end(); ++position) all += cost(position);

  std::vector<TileRun> runs;
  std::size_t next = run.first;
  std::uint64_t before = 0;
  for (int part = 1; part <= parts; ++part) {
    const std::size_t first = next;
    const std::uint64_t goal = all * static_cast<std::uint64_t>(part) / static_cast<std::uint64_t>(parts);
    // A tile goes to the part in which most of it lies.
    while (next < run.end() && (part == parts || before + cost(next) / 2 < goal)) before += cost(next++);
    runs.push_back({first, next - first});
  }
  return runs;
}

Activity share_activity(Communicator& comm, std::span<const std::uint64_t> bits, std::size_t tiles) {
  const std::vector<std::byte> bytes = all_gather_equal(comm, std::as_bytes(bits));
  std::vector<std::uint64_t> all(bytes.size() / sizeof(std::uint64_t));
  if (!bytes.empty()) std::memcpy(all.data(), bytes.data(), bytes.size());
  return {comm.size(), tiles, std::move(all)};
}

}  // namespace hpr
