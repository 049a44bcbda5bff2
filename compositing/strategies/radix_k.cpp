#include "compositing/strategies/radix_k.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "compositing/strategies/strategy.h"
#include "core/error.h"
#include "core/text.h"

namespace hpr {
namespace {

constexpr int kMaxGroup = 8;

/// "4,2" as numbers.
std::vector<int> parse_factors(std::string_view list) {
  std::vector<int> factors;
  for (std::string_view rest = list;; rest.remove_prefix(1)) {
    int factor = 0;
    const auto [end, error] = std::from_chars(rest.data(), rest.data() + rest.size(), factor);
    const bool ends_well = end == rest.data() + rest.size() || *end == ',';
    if (error != std::errc() || factor < 2 || !ends_well) {
      throw Error(ExitCode::Usage, fmt::format("radix-k: '{}' is not a list of factors of 2 or more", printable(list)),
                  "write it like radix-k:4,2");
    }
    factors.push_back(factor);
    rest.remove_prefix(static_cast<std::size_t>(end - rest.data()));
    if (rest.empty()) return factors;
  }
}

}  // namespace

template <typename Pixel>
TileRun SwapRounds<Pixel>::run(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                               const Activity& activity, std::span<const int> factors, int member,
                               const std::function<int(int)>& rank_of) {
  TileRun mine{0, tiles.size()};
  int stride = 1;
  for (const int factor : factors) {
    const int digit = member / stride % factor;
    const std::vector<TileRun> parts = activity.cut(mine, factor);
    if (sent_.size() < static_cast<std::size_t>(factor)) sent_.resize(static_cast<std::size_t>(factor));
    std::vector<Outgoing> out;
    std::vector<int> from;
    // Everyone starts with the member after it, so that not all send to the same one first.
    for (int step = 1; step < factor; ++step) {
      const int other = (digit + step) % factor;
      const int peer = rank_of(member + (other - digit) * stride);
      const auto index = static_cast<std::size_t>(other);
      const TileRun part = parts[index];
      sent_[index].start();
      sent_[index].add(layer, tiles.subspan(part.first, part.count));
      out.push_back(sent_[index].to(peer));
      from.push_back(peer);
    }
    mine = parts[static_cast<std::size_t>(digit)];
    merger_.exchange(comm, out, from, layer, tiles.subspan(mine.first, mine.count));
    stride *= factor;
  }
  return mine;
}

std::vector<int> radix_factors(int ranks) {
  std::vector<int> primes;
  for (int prime = 2; ranks > 1; ++prime) {
    for (; ranks % prime == 0; ranks /= prime) primes.push_back(prime);
  }
  // First fit, the largest primes first.
  std::ranges::reverse(primes);
  std::vector<int> factors;
  for (const int prime : primes) {
    const auto room = std::ranges::find_if(factors, [&](int factor) { return factor * prime <= kMaxGroup; });
    if (room == factors.end()) {
      factors.push_back(prime);
    } else {
      *room *= prime;
    }
  }
  std::ranges::sort(factors, std::greater<>());
  return factors;
}

template <typename Pixel>
RadixK<Pixel>::RadixK(std::string_view written_name) {
  const std::size_t colon = written_name.find(':');
  if (colon != std::string_view::npos) factors_ = parse_factors(written_name.substr(colon + 1));
}

template <typename Pixel>
bool RadixK<Pixel>::fits(int ranks) const {
  if (factors_.empty()) return ranks >= 1;
  std::int64_t product = 1;
  for (const int factor : factors_) product = std::min<std::int64_t>(product * factor, std::int64_t{1} << 31U);
  return product == ranks;
}

template <typename Pixel>
std::optional<Prediction> RadixK<Pixel>::predict(const Costs& costs, const Load& load) const {
  return Prediction{sharing_cost(costs) + swap_rounds_cost(costs, load, factors(load.ranks))};
}

template <typename Pixel>
Composited RadixK<Pixel>::run(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                              std::span<const int> /*shown_by*/) {
  const Activity activity = share_activity(comm, layer, tiles);
  return owning(tiles, rounds_.run(comm, layer, tiles, activity, factors(comm.size()), comm.rank(),
                                   [](int member) { return member; }));
}

template class SwapRounds<Key>;
template class SwapRounds<Rgba8Premultiplied>;
template class SwapRounds<RgbaPremultiplied>;
template class RadixK<Key>;
template class RadixK<Rgba8Premultiplied>;
template class RadixK<RgbaPremultiplied>;

Strategy radix_k_strategy() {
  return scheduled_strategy<RadixK>("radix-k");
}

}  // namespace hpr
