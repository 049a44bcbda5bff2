#include "compositing/binary_swap.h"

#include <bit>

#include "compositing/tile_codec.h"

namespace hpr {
namespace {

/// Ranks paired off until a power of two is left: of ranks 2i and 2i + 1, i < pairs, only the even one stays a member.
class Fold {
 public:
  explicit Fold(int ranks)
      : members_(static_cast<int>(std::bit_floor(static_cast<unsigned>(ranks)))), pairs_(ranks - members_) {}

  [[nodiscard]] int members() const { return members_; }
  [[nodiscard]] bool paired(int rank) const { return rank < 2 * pairs_; }
  [[nodiscard]] int member_of(int rank) const { return paired(rank) ? rank / 2 : rank - pairs_; }
  [[nodiscard]] int rank_of(int member) const { return member < pairs_ ? 2 * member : member + pairs_; }

 private:
  int members_;
  int pairs_;
};

}  // namespace

TileRun BinarySwap::composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles) const {
  const Fold fold(comm.size());
  const int rank = comm.rank();
  if (fold.paired(rank)) {
    if (rank % 2 == 1) {
      comm.send(encode_tiles(layer, tiles), rank - 1);
      return {};
    }
    merge_encoded(layer, tiles, comm.receive(rank + 1));
  }

  const int member = fold.member_of(rank);
  TileRun mine{0, tiles.size()};
  for (int bit = 1; bit < fold.members(); bit *= 2) {
    // Partners agree on all lower bits of their member numbers, so they hold the same run and cut it alike.
    const int partner = member ^ bit;
    const TileRun lower{mine.first, mine.count / 2};
    const TileRun upper{lower.end(), mine.count - lower.count};
    const TileRun theirs = member < partner ? upper : lower;
    mine = member < partner ? lower : upper;
    const auto given = encode_tiles(layer, tiles.subspan(theirs.first, theirs.count));
    merge_encoded(layer, tiles.subspan(mine.first, mine.count), comm.exchange(given, fold.rank_of(partner)));
  }
  return mine;
}

}  // namespace hpr
