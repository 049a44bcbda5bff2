#pragma once

#include <functional>
#include <span>
#include <vector>

#include "cluster/transport/communicator.h"
#include "compositing/activity.h"
#include "compositing/tile_codec.h"
#include "image/tiles.h"

namespace hpr {

/// Rounds in which groups of k members swap parts of the run they share until every member owns a part of its own: what
/// binary swap (k = 2) and radix-k have in common.
template <typename Pixel>
class SwapRounds {
 public:
  /// Members 0 .. product of `factors` - 1 take part, one factor a round; this rank is `member`, and rank_of(m) is the
  /// rank of member m. In each round the members of a group differ in one digit of their numbers and so hold the same
  /// run of `tiles`; they cut it alike, by what all ranks have drawn there. Returns the run this member ends up with.
  ///
  /// Where rank_of ascends, members merge what neighbours in rank hold: the groups of the first round are neighbours,
  /// those of each next one are neighbouring groups.
  TileRun run(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles, const Activity& activity,
              std::span<const int> factors, int member, const std::function<int(int)>& rank_of);

 private:
  std::vector<TileMessage> given_;  ///< per other member of the group
  PieceMerger<Pixel> merger_;
};

}  // namespace hpr
