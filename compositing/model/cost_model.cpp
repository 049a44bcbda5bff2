#include "compositing/model/cost_model.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <vector>

#include "cluster/transport/collectives.h"
#include "compositing/kernels.h"
#include "compositing/model/synthetic.h"
#include "compositing/tile_codec.h"
#include "core/error.h"

namespace hpr {
namespace {

constexpr double kTileBytes = static_cast<double>(kTilePixels * sizeof(Key));
constexpr int kRepetitions = 3;

/// The measurements behind Costs, each taken by all ranks together.
class Probe {
 public:
  Probe(Communicator& comm, std::size_t tiles)
      : comm_(comm),
        layer_(FrameLayout({{kTileSide * static_cast<int>(tiles), kTileSide}})),
        other_(layer_.layout()),
        tiles_(all_tiles(layer_.layout())) {
    draw_everywhere(layer_, comm.rank());
    draw_everywhere(other_, comm.rank() + 1);
  }

  Costs measure() {
    Costs costs;
    costs.ranks = comm_.size();
    if (costs.ranks == 1) return costs;
    const double bytes = kTileBytes * static_cast<double>(tiles_.size());
    costs.message = seconds([&] { barrier(comm_); }) / rounds_of(costs.ranks);
    const int half = costs.ranks / 2;
    const int to = (comm_.rank() + half) % costs.ranks;
    const int from = (comm_.rank() + costs.ranks - half) % costs.ranks;
    costs.swap_byte = seconds([&] { move(true, to, true, from, true); }) / bytes;
    // From the rank furthest off, which another host may hold.
    const int last = costs.ranks - 1;
    const bool is_first = comm_.rank() == 0;
    const bool is_last = comm_.rank() == last;
    costs.pull_byte = seconds([&] { move(is_last, 0, is_first, last, true); }) / bytes;
    costs.collect_byte = seconds([&] { move(is_last, 0, is_first, last, false); }) / bytes;
    costs.swap_byte = std::max(costs.swap_byte, costs.pull_byte);
    costs.reduce_byte = seconds([&] { comm_.reduce_max(other_.run({0, tiles_.size()}), 0); }) / bytes;
    const double scattered = scatter();
    const double packed = seconds([&] { move(is_last, 0, is_first, last, true); }) / scattered;
    costs.packing_byte = std::max(0.0, packed - costs.pull_byte);
    measure_hosts(costs, bytes);
    return costs;
  }

 private:
  /// The median over repetitions of the slowest rank's time.
  double seconds(const std::function<void()>& work) {
    std::vector<double> times;
    for (int i = 0; i < kRepetitions; ++i) {
      barrier(comm_);
      const double start = comm_.seconds();
      work();
      const std::vector<double> all = all_gather_value(comm_, comm_.seconds() - start);
      times.push_back(std::ranges::max(all));
    }
    std::ranges::nth_element(times, times.begin() + kRepetitions / 2);
    return times[kRepetitions / 2];
  }

  void move(bool sends, int to, bool receives, int from, bool merges) {
    std::vector<Outgoing> out;
    if (sends) {
      message_.start();
      message_.add(layer_, tiles_);
      out.push_back(message_.to(to));
    }
    const std::vector<int> senders(receives ? 1 : 0, from);
    comm_.exchange(out, senders, [&](int peer, std::span<const std::byte> message) {
      if (merges) {
        reader_.merge(comm_, peer, message, other_, tiles_);
      } else {
        reader_.replace(comm_, peer, message, other_, tiles_);
      }
    });
  }

  /// Leaves every other pixel of the layer; returns the bytes it packs to.
  double scatter() {
    for (const std::size_t tile : tiles_) {
      for (std::size_t i = 0; i < kTilePixels; i += 2) layer_.tile(tile)[i] = kNoKey;
    }
    return static_cast<double>(tiles_.size()) * (kTileBytes / 2.0 + sizeof(TileMask));
  }

  void measure_hosts(Costs& costs, double bytes) {
    try {
      const auto meeting = comm_.share(1);
      std::vector<int> hosts = hosts_of(comm_, *meeting);
      std::ranges::sort(hosts);
      costs.hosts = static_cast<int>(std::unique(hosts.begin(), hosts.end()) - hosts.begin());
      costs.meet = seconds([&] { meeting->meet(); });
      TileLayer<Key> mine(layer_.layout(), comm_.share(TileLayer<Key>::bytes_for(layer_.layout())));
      const double ranks_here = static_cast<double>(comm_.size()) / costs.hosts;
      costs.read_byte = std::max(0.0, merging_in_place(mine) - costs.meet) / (bytes * ranks_here);
    } catch (const Error& error) {
      if (error.code() != ExitCode::Limit) throw;  // too little shared memory, on all ranks alike: none is used
    }
  }

  /// Every rank merges a whole layer out of the memory of another rank of its host.
  double merging_in_place(const TileLayer<Key>& mine) {
    PeerMemory& memory = *mine.peers();
    int neighbour = (comm_.rank() + 1) % comm_.size();
    while (memory.of(neighbour).empty()) neighbour = (neighbour + 1) % comm_.size();
    const TileLayer<Key> theirs = mine.of_peer(neighbour);
    return seconds([&] {
      memory.meet();
      merge_keys(other_.run({0, tiles_.size()}), theirs.run({0, tiles_.size()}));
      comm_.worked(theirs.run({0, tiles_.size()}).size_bytes());
    });
  }

  Communicator& comm_;
  TileLayer<Key> layer_;
  TileLayer<Key> other_;
  std::vector<std::size_t> tiles_;
  TileMessage message_;
  TileReader reader_;
};

}  // namespace

Costs Costs::with_packed(double fraction) const {
  Costs costs = *this;
  if (pull_byte <= 0.0) return costs;
  costs.pull_byte += fraction * packing_byte;
  costs.swap_byte += fraction * packing_byte * swap_byte / pull_byte;
  return costs;
}

double Costs::byte(double receivers) const {
  if (ranks < 2) return pull_byte;
  return pull_byte + (swap_byte - pull_byte) * std::clamp((receivers - 1.0) / (ranks - 1.0), 0.0, 1.0);
}

Costs measure_costs(Communicator& comm, std::size_t tiles) {
  Costs costs = Probe(comm, tiles).measure();
  // Ranks time alike but not to the bit, and must decide alike.
  std::vector<std::byte> bytes(sizeof costs);
  std::memcpy(bytes.data(), &costs, sizeof costs);
  broadcast(comm, bytes);
  HPR_CHECK(bytes.size() == sizeof costs);
  std::memcpy(&costs, bytes.data(), sizeof costs);
  return costs;
}

double Load::merged(double layers) const {
  if (area <= 0.0) return 0.0;
  const double drawn = std::min(1.0, mean_layer / area);
  return area * (1.0 - std::pow(1.0 - drawn, layers));
}

Load share_load(Communicator& comm, const TileLayer<Key>& layer, std::span<const std::size_t> tiles) {
  struct Bytes {
    double whole = 0.0;
    double packed = 0.0;
  } mine;
  for (const std::size_t tile : tiles) {
    if (!layer.active(tile)) continue;
    const double fraction = sampled_fraction<Key>(layer.tile(tile));
    const bool packs = fraction * kTilePixels <= kMaxPackedPixels;
    (packs ? mine.packed : mine.whole) += kTileBytes * (packs ? fraction + 1.0 / 64.0 : 1.0);
  }
  const Activity activity = share_activity(comm, layer, tiles);
  Bytes all;
  for (const Bytes& bytes : all_gather_value(comm, mine)) {
    all.whole += bytes.whole;
    all.packed += bytes.packed;
  }

  Load load;
  load.ranks = comm.size();
  load.frame = kTileBytes * static_cast<double>(tiles.size());
  load.mean_layer = (all.whole + all.packed) / comm.size();
  load.packed_fraction = load.mean_layer > 0.0 ? all.packed / (all.whole + all.packed) : 0.0;
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    load.drawn_tiles += kTileBytes * activity.weight(i);
    if (activity.weight(i) > 0) load.area += kTileBytes;
  }
  return load;
}

double Prediction::collected(const Costs& costs, const Load& load) const {
  if (!spread || load.ranks == 1) return composite;
  return composite + costs.message + load.merged(load.ranks) * (1.0 - 1.0 / load.ranks) * costs.collect_byte;
}

int rounds_of(int ranks) {
  int rounds = 0;
  for (int reached = 1; reached < ranks; reached *= 2) ++rounds;
  return rounds;
}

double sharing_cost(const Costs& costs) {
  return costs.message * rounds_of(costs.ranks);
}

double swap_rounds_cost(const Costs& costs, const Load& load, std::span<const int> factors, double layers_before,
                        double part) {
  double seconds = 0.0;
  double layers = layers_before;
  for (const int factor : factors) {
    // A group's messages overlap: half of each counts, and all of one.
    seconds += costs.message * factor / 2.0;
    part /= factor;
    seconds += load.merged(layers) * part * (factor - 1) * costs.swap_byte;
    layers *= factor;
  }
  return seconds;
}

}  // namespace hpr
