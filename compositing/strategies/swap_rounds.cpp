#include "compositing/strategies/swap_rounds.h"

namespace hpr {

template <typename Pixel>
TileRun SwapRounds<Pixel>::run(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                               const Activity& activity, std::span<const int> factors, int member,
                               const std::function<int(int)>& rank_of) {
  TileRun mine{0, tiles.size()};
  int stride = 1;
  for (const int factor : factors) {
    const int digit = member / stride % factor;
    const std::vector<TileRun> parts = activity.cut(mine, factor);
    if (given_.size() < static_cast<std::size_t>(factor)) given_.resize(static_cast<std::size_t>(factor));
    std::vector<Outgoing> out;
    std::vector<int> from;
    // Everyone starts with the member after it, so that not all send to the same one first.
    for (int step = 1; step < factor; ++step) {
      const int other = (digit + step) % factor;
      const int peer = rank_of(member + (other - digit) * stride);
      const auto index = static_cast<std::size_t>(other);
      const TileRun part = parts[index];
      given_[index].start();
      given_[index].add(layer, tiles.subspan(part.first, part.count));
      out.push_back(given_[index].to(peer));
      from.push_back(peer);
    }
    mine = parts[static_cast<std::size_t>(digit)];
    merger_.exchange(comm, out, from, layer, tiles.subspan(mine.first, mine.count));
    stride *= factor;
  }
  return mine;
}

template class SwapRounds<Key>;
template class SwapRounds<Rgba8Premultiplied>;
template class SwapRounds<RgbaPremultiplied>;

}  // namespace hpr
