#include "compositing/strategies/direct_send.h"

#include <algorithm>
#include <numeric>

#include "compositing/activity.h"
#include "compositing/strategies/strategy.h"

namespace hpr {
namespace {

/// How much more than an equal share the busiest rank may have to merge for tiles to go straight to their screens.
constexpr double kMaxImbalance = 1.25;

/// Positions in the list of tiles, per rank that owns them.
using Pieces = std::vector<std::vector<std::size_t>>;

Pieces by_screen(const FrameLayout& layout, std::span<const std::size_t> tiles, std::span<const int> shown_by,
                 int ranks) {
  Pieces pieces(static_cast<std::size_t>(ranks));
  for (std::size_t position = 0; position < tiles.size(); ++position) {
    const int owner = shown_by[layout.place(tiles[position]).screen];
    pieces[static_cast<std::size_t>(owner)].push_back(position);
  }
  return pieces;
}

Pieces by_weight(const Activity& activity) {
  Pieces pieces;
  for (const TileRun run : activity.cut({0, activity.tiles()}, activity.ranks())) {
    auto& piece = pieces.emplace_back(run.count);
    std::iota(piece.begin(), piece.end(), run.first);
  }
  return pieces;
}

bool balanced(const Pieces& pieces, const Activity& activity) {
  std::uint64_t most = 0;
  std::uint64_t all = 0;
  for (const auto& piece : pieces) {
    std::uint64_t weight = 0;
    for (const std::size_t position : piece) weight += activity.weight(position);
    most = std::max(most, weight);
    all += weight;
  }
  return static_cast<double>(most) * static_cast<double>(pieces.size()) <= kMaxImbalance * static_cast<double>(all);
}

std::vector<std::size_t> tiles_at(std::span<const std::size_t> tiles, const std::vector<std::size_t>& positions) {
  std::vector<std::size_t> some;
  some.reserve(positions.size());
  for (const std::size_t position : positions) some.push_back(tiles[position]);
  return some;
}

}  // namespace

template <typename Pixel>
Composited DirectSend<Pixel>::run(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                                  std::span<const int> shown_by) {
  const int ranks = comm.size();
  const int rank = comm.rank();
  const Activity activity = share_activity(comm, layer, tiles);
  Pieces pieces;
  if (!shown_by.empty()) pieces = by_screen(layer.layout(), tiles, shown_by, ranks);
  const bool straight = !shown_by.empty() && balanced(pieces, activity);
  if (!straight) pieces = by_weight(activity);

  const auto draws_into = [&](int who, int owner) {
    return std::ranges::any_of(pieces[static_cast<std::size_t>(owner)],
                               [&](std::size_t position) { return activity.active(who, position); });
  };
  sent_.resize(static_cast<std::size_t>(ranks));
  std::vector<Outgoing> out;
  std::vector<int> from;
  // Everyone starts with the rank after it, so that not all send to the same one first.
  for (int step = 1; step < ranks; ++step) {
    const int to = (rank + step) % ranks;
    const int sender = (rank + ranks - step) % ranks;
    const auto index = static_cast<std::size_t>(to);
    if (draws_into(rank, to)) {
      sent_[index].start();
      sent_[index].add(layer, tiles_at(tiles, pieces[index]));
      out.push_back(sent_[index].to(to));
    }
    if (draws_into(sender, rank)) from.push_back(sender);
  }
  std::vector<std::size_t> mine = tiles_at(tiles, pieces[static_cast<std::size_t>(rank)]);
  merger_.exchange(comm, out, from, layer, mine);
  return {std::move(mine), straight};
}

template <typename Pixel>
std::optional<Prediction> DirectSend<Pixel>::predict(const Costs& costs, const Load& load) const {
  const int ranks = load.ranks;
  return Prediction{sharing_cost(costs) + swap_rounds_cost(costs, load, {&ranks, 1})};
}

template class DirectSend<Key>;
template class DirectSend<Rgba8Premultiplied>;
template class DirectSend<RgbaPremultiplied>;

Strategy direct_send_strategy() {
  return scheduled_strategy<DirectSend>("direct-send");
}

}  // namespace hpr
