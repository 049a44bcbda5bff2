#include "compositing/strategies/radix_k.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "core/error.h"
#include "core/text.h"

namespace hpr {
namespace {

constexpr int kLargestGroup = 8;

}  // namespace

std::vector<int> parse_radix_factors(std::string_view list) {
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

RadixK::RadixK(std::string_view factors)
    : name_(fmt::format("radix-k:{}", factors)), schedule_(parse_radix_factors(factors)) {}

template <typename Pixel>
bool RadixKSchedule<Pixel>::fits(int ranks) const {
  if (factors_.empty()) return ranks >= 1;
  std::int64_t product = 1;
  for (const int factor : factors_) product = std::min<std::int64_t>(product * factor, std::int64_t{1} << 31U);
  return product == ranks;
}

template <typename Pixel>
std::vector<int> RadixKSchedule<Pixel>::factors(int ranks) const {
  return factors_.empty() ? RadixK::factors_for(ranks) : factors_;
}

std::vector<int> RadixK::factors_for(int ranks) {
  std::vector<int> primes;
  for (int prime = 2; ranks > 1; ++prime) {
    for (; ranks % prime == 0; ranks /= prime) primes.push_back(prime);
  }
  // First fit, the largest primes first.
  std::ranges::reverse(primes);
  std::vector<int> factors;
  for (const int prime : primes) {
    const auto room = std::ranges::find_if(factors, [&](int factor) { return factor * prime <= kLargestGroup; });
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
Composited RadixKSchedule<Pixel>::run(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                                      std::span<const int> /*shown_by*/) {
  const Activity activity = share_activity(comm, layer, tiles);
  return owning(tiles, rounds_.run(comm, layer, tiles, activity, factors(comm.size()), comm.rank(),
                                   [](int member) { return member; }));
}

template class RadixKSchedule<Key>;
template class RadixKSchedule<Rgba8Premultiplied>;
template class RadixKSchedule<RgbaPremultiplied>;

Composited RadixK::composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                             std::span<const int> shown_by) {
  return schedule_.run(comm, layer, tiles, shown_by);
}

std::optional<Prediction> RadixK::predict(const Costs& costs, const Load& load) const {
  return Prediction{sharing_cost(costs) + swap_rounds_cost(costs, load, schedule_.factors(load.ranks))};
}

}  // namespace hpr
