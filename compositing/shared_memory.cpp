#include "compositing/shared_memory.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <utility>

#include "cluster/collectives.h"
#include "compositing/activity.h"
#include "compositing/merge.h"
#include "compositing/radix_k.h"
#include "core/check.h"

namespace hpr {
namespace {

/// Tiles a rank takes at a time: few enough that the last ones end together, enough to seldom meet at the counter.
constexpr std::size_t kTilesATurn = 4;

}  // namespace

/// Who is where, and the counter by which the ranks of this host share their work.
class SharedMemory::Host {
 public:
  explicit Host(Communicator& comm) : comm_(comm), control_(comm.share(sizeof(Control))) {
    int first = 0;
    while (control_->of(first).empty()) ++first;
    control_of_host_ = reinterpret_cast<Control*>(control_->of(first).data());
    const std::vector<int> hosts = all_gather_value(comm, first);  // a host is named by its first rank
    std::vector<int> names(hosts);
    std::ranges::sort(names);
    names.erase(std::unique(names.begin(), names.end()), names.end());
    for (const int name : names) {
      std::vector<int> ranks;
      for (int rank = 0; rank < comm.size(); ++rank) {
        if (hosts[static_cast<std::size_t>(rank)] == name) ranks.push_back(rank);
      }
      if (name == first) ranks_ = ranks;
      hosts_.push_back(std::move(ranks));
    }
    if (hosts_.size() == 1) return;
    // Peers of like number: one column per number that exists on every host.
    columns_ = std::ranges::min(hosts_, {}, &std::vector<int>::size).size();
    const auto number = static_cast<std::size_t>(std::ranges::find(ranks_, comm.rank()) - ranks_.begin());
    if (number >= columns_) return;
    std::vector<int> members;
    for (const auto& ranks : hosts_) members.push_back(ranks[number]);
    std::ranges::sort(members);
    column_ = comm.subset(members);
  }

  [[nodiscard]] bool belongs_to(const Communicator& comm) const { return &comm_ == &comm; }
  [[nodiscard]] bool alone() const { return hosts_.size() == 1; }
  [[nodiscard]] const std::vector<int>& ranks() const { return ranks_; }
  [[nodiscard]] std::size_t columns() const { return columns_; }
  /// Null for a rank no other host has a peer for.
  [[nodiscard]] Communicator* column() { return column_.get(); }
  [[nodiscard]] Compositor& between_hosts() { return between_hosts_; }

  void meet() { control_->meet(); }

  /// Starts a frame, after a barrier all ranks of the host came through.
  void start_frame() {
    took_share_ = false;
    turn_ = (turn_ + 1) % control_of_host_->next.size();
    // The counter of the coming frame: nobody uses it before the next barrier, nor after the last one.
    counter((turn_ + 1) % control_of_host_->next.size()).store(0, std::memory_order_relaxed);
  }
  /// The next tiles nobody has taken; where time is a model, the next of a fixed share.
  [[nodiscard]] TileRun take(const Activity& activity) {
    const std::size_t tiles = activity.tiles();
    if (comm_.models_time()) {
      const auto number = static_cast<std::size_t>(std::ranges::find(ranks_, comm_.rank()) - ranks_.begin());
      if (std::exchange(took_share_, true)) return {tiles, 0};
      return activity.cut({0, tiles}, static_cast<int>(ranks_.size()))[number];
    }
    const std::size_t first = counter(turn_).fetch_add(kTilesATurn, std::memory_order_relaxed);
    if (first >= tiles) return {tiles, 0};
    return {first, std::min(kTilesATurn, tiles - first)};
  }

 private:
  struct Control {
    std::array<std::size_t, 2> next;  ///< position in the list of tiles, of this frame and the coming one
  };

  [[nodiscard]] std::atomic_ref<std::size_t> counter(std::size_t turn) const {
    return std::atomic_ref(control_of_host_->next.at(turn));
  }

  Communicator& comm_;
  std::shared_ptr<PeerMemory> control_;
  Control* control_of_host_ = nullptr;
  std::vector<std::vector<int>> hosts_;  ///< the ranks of each
  std::vector<int> ranks_;               ///< of this host, ascending
  std::size_t columns_ = 0;
  std::unique_ptr<Communicator> column_;
  RadixK between_hosts_;
  std::size_t turn_ = 0;
  bool took_share_ = false;
};

namespace {

/// Which tiles the ranks of this host have drawn into.
Activity look_at(std::span<const TileLayer<Key>> layers, std::span<const std::size_t> tiles) {
  const std::size_t words = (tiles.size() + 63) / 64;
  std::vector<std::uint64_t> bits(words * layers.size());
  for (std::size_t rank = 0; rank < layers.size(); ++rank) {
    for (std::size_t i = 0; i < tiles.size(); ++i) {
      if (layers[rank].active(tiles[i])) bits[rank * words + i / 64] |= std::uint64_t{1} << (i % 64);
    }
  }
  return {static_cast<int>(layers.size()), tiles.size(), std::move(bits)};
}

/// Merges what all layers hold of a tile into that of `owner`, all indices into `layers`; flags stay as they are, since
/// others may be looking at them. Returns the bytes read.
std::size_t merge_tile(std::span<TileLayer<Key>> layers, const Activity& activity, std::size_t position,
                       std::size_t tile, std::size_t owner) {
  const std::span<Key> into = layers[owner].tile(tile);
  bool filled = activity.active(static_cast<int>(owner), position);
  std::size_t bytes = 0;
  for (std::size_t other = 0; other < layers.size(); ++other) {
    if (other == owner || !activity.active(static_cast<int>(other), position)) continue;
    const std::span<const Key> from = std::as_const(layers[other]).tile(tile);
    if (filled) {
      merge_keys(into, from);
    } else {
      std::ranges::copy(from, into.begin());
    }
    filled = true;
    bytes += from.size_bytes();
  }
  return bytes;
}

}  // namespace

SharedMemory::SharedMemory() = default;
SharedMemory::~SharedMemory() = default;

Composited SharedMemory::composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                                   std::span<const int> shown_by) {
  if (!host_ || !host_->belongs_to(comm)) {
    host_ = std::make_unique<Host>(comm);
    copy_ = {};
  }
  const bool in_place = layer.peers() != nullptr;
  if (!in_place) {
    if (copy_.peers() == nullptr || copy_.layout() != layer.layout()) {
      copy_ = TileLayer<Key>(layer.layout(), comm.share(TileLayer<Key>::bytes_for(layer.layout())));
    }
    copy_tiles(layer, copy_, tiles);
  }
  TileLayer<Key>& shared = in_place ? layer : copy_;
  std::vector<TileLayer<Key>> layers;
  for (const int rank : host_->ranks()) layers.push_back(shared.of_peer(rank));
  const auto index_of = [&](int rank) {
    return static_cast<std::size_t>(std::ranges::find(host_->ranks(), rank) - host_->ranks().begin());
  };

  host_->meet();  // all layers are drawn
  host_->start_frame();
  const Activity here = look_at(layers, tiles);
  const bool straight = host_->alone() && !shown_by.empty();
  std::vector<std::size_t> owners;  // per position, as an index of a layer
  if (straight) {
    for (const std::size_t tile : tiles) owners.push_back(index_of(shown_by[shared.layout().place(tile).screen]));
  } else {
    // Hosts must cut alike, so between hosts all ranks' tiles are weighed.
    const auto runs =
        host_->alone() ? here.cut({0, tiles.size()}, comm.size())
                       : share_activity(comm, shared, tiles).cut({0, tiles.size()}, static_cast<int>(host_->columns()));
    for (std::size_t run = 0; run < runs.size(); ++run) owners.insert(owners.end(), runs[run].count, run);
  }

  for (TileRun turn = host_->take(here); turn.count > 0; turn = host_->take(here)) {
    std::size_t bytes = 0;
    for (std::size_t i = turn.first; i < turn.end(); ++i) bytes += merge_tile(layers, here, i, tiles[i], owners[i]);
    comm.worked(bytes);
  }
  host_->meet();  // all tiles are merged, and nobody reads this rank's layer any more

  std::vector<std::size_t> mine;
  const std::size_t self = index_of(comm.rank());
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    if (owners[i] != self) continue;
    mine.push_back(tiles[i]);
    if (here.weight(i) > 0) shared.set_active(tiles[i]);
  }
  Composited result{std::move(mine), straight};
  if (!host_->alone()) {
    result = host_->column() == nullptr ? Composited{}
                                        : host_->between_hosts().composite(*host_->column(), shared, result.tiles);
  }
  if (!in_place) copy_tiles(shared, layer, result.tiles);
  return result;
}

void SharedMemory::copy_tiles(const TileLayer<Key>& from, TileLayer<Key>& to, std::span<const std::size_t> tiles) {
  for (const std::size_t tile : tiles) {
    if (from.active(tile)) {
      std::ranges::copy(from.tile(tile), to.tile(tile).begin());
      to.set_active(tile);
    } else {
      to.clear(tile);
    }
  }
}

std::optional<Prediction> SharedMemory::predict(const Costs& costs, const Load& load) const {
  if (costs.read_byte <= 0.0) return std::nullopt;
  const double per_host = load.drawn_tiles / costs.hosts * costs.read_byte;
  double seconds = 2.0 * costs.meet + per_host;
  if (costs.hosts == 1) return Prediction{seconds, false};
  const int columns = std::max(1, load.ranks / costs.hosts);
  seconds += 2.0 * sharing_cost(costs) +
             swap_rounds_cost(costs, load, RadixK::factors_for(costs.hosts), columns, 1.0 / columns);
  return Prediction{seconds};
}

}  // namespace hpr
