#include <algorithm>
#include <array>
#include <atomic>
#include <utility>

#include "cluster/transport/collectives.h"
#include "cluster/transport/communicator_wrappers.h"
#include "compositing/activity.h"
#include "compositing/kernels.h"
#include "compositing/strategies/direct_send.h"
#include "compositing/strategies/radix_k.h"
#include "compositing/strategies/strategy.h"
#include "compositing/tile_codec.h"
#include "core/error.h"

namespace hpr {
namespace {

/// Tiles a rank takes at a time: few enough that the last ones end together, enough to seldom meet at the counter.
constexpr std::size_t kTilesATurn = 4;

/// Which ranks are on which host, and the counter by which those of this host share their work.
class HostRanks {
 public:
  explicit HostRanks(Communicator& comm) : comm_(comm), control_(comm.share(sizeof(Control))) {
    const std::vector<int> hosts = hosts_of(comm, *control_);
    const int first = hosts[static_cast<std::size_t>(comm.rank())];
    control_of_host_ = reinterpret_cast<Control*>(control_->of(first).data());
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
    for (const auto& ranks : hosts_) column_ranks_.push_back(ranks[number]);
    std::ranges::sort(column_ranks_);
    column_ = comm.subset(column_ranks_);
  }

  [[nodiscard]] bool belongs_to(const Communicator& comm) const { return &comm_ == &comm; }
  [[nodiscard]] bool alone() const { return hosts_.size() == 1; }
  [[nodiscard]] const std::vector<int>& ranks() const { return ranks_; }
  [[nodiscard]] std::size_t columns() const { return columns_; }
  /// Null for a rank no other host has a peer for.
  [[nodiscard]] Communicator* column() { return column_.get(); }
  /// The rank in the whole communicator of each rank of the column, ascending.
  [[nodiscard]] const std::vector<int>& column_ranks() const { return column_ranks_; }

  /// Whether no host's ranks have another host's among them in this order.
  [[nodiscard]] bool holds_runs_of(std::span<const int> order) const {
    std::size_t changes = 0;
    for (std::size_t i = 1; i < order.size(); ++i) changes += host_of(order[i]) != host_of(order[i - 1]) ? 1U : 0U;
    return changes + 1 == hosts_.size();
  }

  void meet() { control_->meet(); }

  /// Starts a frame, after a barrier all ranks of the host came through.
  void start_frame() {
    took_part_ = false;
    turn_ = (turn_ + 1) % control_of_host_->next.size();
    // The counter of the coming frame: nobody uses it before the next barrier, nor after the last one.
    counter((turn_ + 1) % control_of_host_->next.size()).store(0, std::memory_order_relaxed);
  }
  /// The next tiles nobody has taken; where time is a model, the next of a fixed share.
  [[nodiscard]] TileRun take(const Activity& activity) {
    const std::size_t tiles = activity.tiles();
    if (comm_.models_time()) {
      const auto number = static_cast<std::size_t>(std::ranges::find(ranks_, comm_.rank()) - ranks_.begin());
      if (std::exchange(took_part_, true)) return {tiles, 0};
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

  [[nodiscard]] std::size_t host_of(int rank) const {
    const auto has = [&](const std::vector<int>& ranks) { return std::ranges::find(ranks, rank) != ranks.end(); };
    return static_cast<std::size_t>(std::ranges::find_if(hosts_, has) - hosts_.begin());
  }
  [[nodiscard]] std::atomic_ref<std::size_t> counter(std::size_t turn) const {
    return std::atomic_ref(control_of_host_->next.at(turn));
  }

  Communicator& comm_;
  std::shared_ptr<PeerMemory> control_;
  Control* control_of_host_ = nullptr;
  std::vector<std::vector<int>> hosts_;  ///< the ranks of each
  std::vector<int> ranks_;               ///< of this host, ascending
  std::size_t columns_ = 0;
  std::vector<int> column_ranks_;
  std::unique_ptr<Communicator> column_;
  std::size_t turn_ = 0;
  bool took_part_ = false;
};

/// Which tiles the ranks of this host have drawn into.
template <typename Pixel>
Activity activity_of(std::span<const TileLayer<Pixel>> layers, std::span<const std::size_t> tiles) {
  std::vector<std::uint64_t> fills;
  for (const TileLayer<Pixel>& layer : layers) {
    // Work on a host goes to who is free: counting pixels would buy nothing.
    const std::vector<std::uint64_t> own = tile_fills(layer, tiles, false);
    fills.insert(fills.end(), own.begin(), own.end());
  }
  return {static_cast<int>(layers.size()), tiles.size(), std::move(fills)};
}

/// Merges what all layers hold of tiles into the layer of one of them, flags staying as they are, since others may be
/// looking at them. `order`: the indices of the layers from front to back.
template <typename Pixel>
class TileMerger {
 public:
  TileMerger(std::span<TileLayer<Pixel>> layers, std::span<const std::size_t> order, const Activity& activity)
      : layers_(layers), order_(order), activity_(activity) {}

  /// Into that of `owner`. Returns the bytes read.
  std::size_t merge(std::size_t position, std::size_t tile, std::size_t owner) {
    const std::span<Pixel> into = layers_[owner].tile(tile);
    fold_.start(into, activity_.active(static_cast<int>(owner), position));
    std::size_t bytes = 0;
    for (const std::size_t index : order_) {
      if (!activity_.active(static_cast<int>(index), position)) continue;
      const std::span<const Pixel> content = std::as_const(layers_[index]).tile(tile);
      fold_.add(content);
      if (index != owner) bytes += content.size_bytes();
    }
    fold_.finish();
    return bytes;
  }

 private:
  std::span<TileLayer<Pixel>> layers_;
  std::span<const std::size_t> order_;
  const Activity& activity_;
  TileFold<Pixel> fold_;
};

/// Keys in any order, straight where they belong.
template <>
class TileMerger<Key> {
 public:
  TileMerger(std::span<TileLayer<Key>> layers, std::span<const std::size_t> /*order*/, const Activity& activity)
      : layers_(layers), activity_(activity) {}

  std::size_t merge(std::size_t position, std::size_t tile, std::size_t owner) {
    const std::span<Key> into = layers_[owner].tile(tile);
    bool filled = activity_.active(static_cast<int>(owner), position);
    std::size_t bytes = 0;
    for (std::size_t other = 0; other < layers_.size(); ++other) {
      if (other == owner || !activity_.active(static_cast<int>(other), position)) continue;
      const std::span<const Key> from = std::as_const(layers_[other]).tile(tile);
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

 private:
  std::span<TileLayer<Key>> layers_;
  const Activity& activity_;
};

std::size_t position_in(std::span<const int> list, int value) {
  return static_cast<std::size_t>(std::ranges::find(list, value) - list.begin());
}

/// The places in `list` of those ranks of `order` that stand there, in that order.
std::vector<std::size_t> positions_of(std::span<const int> order, std::span<const int> list) {
  std::vector<std::size_t> positions;
  for (const int rank : order) {
    const std::size_t position = position_in(list, rank);
    if (position < list.size()) positions.push_back(position);
  }
  return positions;
}

/// The messages and merges of the strategy, for any kind of pixel.
template <typename Pixel>
class SharedMemorySchedule {
 public:
  /// `order`: the ranks from front to back, which only colours ask for; keys have none.
  Composited run(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                 std::span<const int> order, std::span<const int> shown_by);

 private:
  Composited merge_on_host(Communicator& comm, TileLayer<Pixel>& shared, std::span<const std::size_t> tiles,
                           std::span<const int> order, std::span<const int> shown_by);
  Composited merge_between_hosts(TileLayer<Pixel>& shared, const Composited& of_host, std::span<const int> order);

  std::unique_ptr<HostRanks> host_;  ///< of the communicator of the last call
  TileLayer<Pixel> copy_;            ///< of layers that live elsewhere
  RadixK<Pixel> between_hosts_;      ///< of a run of the order on each
  DirectSend<Pixel> out_of_order_;   ///< where the order runs to and fro between hosts
};

template <typename Pixel>
Composited SharedMemorySchedule<Pixel>::run(Communicator& comm, TileLayer<Pixel>& layer,
                                            std::span<const std::size_t> tiles, std::span<const int> order,
                                            std::span<const int> shown_by) {
  if (!host_ || !host_->belongs_to(comm)) {
    host_ = std::make_unique<HostRanks>(comm);
    copy_ = {};
  }
  if (!order.empty() && !host_->holds_runs_of(order)) {
    RenumberedCommunicator ordered(comm, order);
    std::vector<int> shown_at;
    for (const int rank : shown_by) shown_at.push_back(static_cast<int>(position_in(order, rank)));
    return out_of_order_.run(ordered, layer, tiles, shown_at);
  }
  const bool in_place = layer.peers() != nullptr;
  if (!in_place) {
    if (copy_.peers() == nullptr || copy_.layout() != layer.layout()) {
      copy_ = TileLayer<Pixel>(layer.layout(), comm.share(TileLayer<Pixel>::bytes_for(layer.layout())));
    }
    copy_.set_depth_format(layer.depth_format());
    copy_tiles(layer, copy_, tiles);
  }
  TileLayer<Pixel>& shared = in_place ? layer : copy_;
  Composited result = merge_on_host(comm, shared, tiles, order, shown_by);
  if (!host_->alone()) result = merge_between_hosts(shared, result, order);
  if (!in_place) copy_tiles(shared, layer, result.tiles);
  return result;
}

template <typename Pixel>
Composited SharedMemorySchedule<Pixel>::merge_on_host(Communicator& comm, TileLayer<Pixel>& shared,
                                                      std::span<const std::size_t> tiles, std::span<const int> order,
                                                      std::span<const int> shown_by) {
  std::vector<TileLayer<Pixel>> layers;
  for (const int rank : host_->ranks()) layers.push_back(shared.of_peer(rank));
  const std::vector<std::size_t> front_to_back = positions_of(order, host_->ranks());

  host_->meet();  // all layers are drawn
  host_->start_frame();
  const Activity here = activity_of<Pixel>(layers, tiles);
  const bool straight = host_->alone() && !shown_by.empty();
  std::vector<std::size_t> owners;  // per position, as an index of a layer
  if (straight) {
    for (const std::size_t tile : tiles) {
      owners.push_back(position_in(host_->ranks(), shown_by[shared.layout().place(tile).screen]));
    }
  } else {
    // Hosts must cut alike, so between hosts all ranks' tiles are weighed.
    const auto runs =
        host_->alone() ? here.cut({0, tiles.size()}, comm.size())
                       : share_activity(comm, shared, tiles).cut({0, tiles.size()}, static_cast<int>(host_->columns()));
    for (std::size_t run = 0; run < runs.size(); ++run) owners.insert(owners.end(), runs[run].count, run);
  }

  TileMerger<Pixel> merger(layers, front_to_back, here);
  for (TileRun turn = host_->take(here); turn.count > 0; turn = host_->take(here)) {
    std::size_t bytes = 0;
    for (std::size_t i = turn.first; i < turn.end(); ++i) bytes += merger.merge(i, tiles[i], owners[i]);
    comm.worked(bytes);
  }
  host_->meet();  // all tiles are merged, and nobody reads this rank's layer any more

  std::vector<std::size_t> mine;
  const std::size_t self = position_in(host_->ranks(), comm.rank());
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    if (owners[i] != self) continue;
    mine.push_back(tiles[i]);
    if (here.weight(i) > 0) shared.set_active(tiles[i]);
  }
  return {std::move(mine), straight};
}

template <typename Pixel>
Composited SharedMemorySchedule<Pixel>::merge_between_hosts(TileLayer<Pixel>& shared, const Composited& of_host,
                                                            std::span<const int> order) {
  Communicator* const column = host_->column();
  if (column == nullptr) return {};
  if (order.empty()) return between_hosts_.run(*column, shared, of_host.tiles, {});
  const std::vector<std::size_t> hosts = positions_of(order, host_->column_ranks());  // front to back
  RenumberedCommunicator ordered(*column, std::vector<int>(hosts.begin(), hosts.end()));
  return between_hosts_.run(ordered, shared, of_host.tiles, {});
}

/// The ranks of a host merge each other's layers where they lie, without a message: whoever is free takes the next
/// tiles, reads them in all layers and writes the nearest keys into the layer of the rank that is to own them, straight
/// where they are shown when that rank is on this host. Between hosts, the ranks of like number on each host then
/// composite what they own by radix-k: two levels, each as fast as its medium.
///
/// Composites in place when the layers of all ranks live in the memory of `comm`'s share(); else, also on all ranks,
/// through a copy that does.
///
/// Cost on one host: two barriers; every drawn tile is read once and every tile of the result written once, shared
/// among the ranks as they find time, so that ranks that wait for a core hold nobody up.
class SharedMemory final : public Compositor {
 public:
  [[nodiscard]] std::string_view name() const override { return "shared-memory"; }
  [[nodiscard]] bool merges_in_place() const override { return true; }

  [[nodiscard]] std::optional<Prediction> predict(const Costs& costs, const Load& load) const override {
    if (!costs.read_byte) return std::nullopt;
    const double per_host = load.drawn_tiles / costs.hosts * *costs.read_byte;
    double seconds = 2.0 * costs.meet + per_host;
    if (costs.hosts == 1) return Prediction{seconds, false};
    const int columns = std::max(1, load.ranks / costs.hosts);
    seconds +=
        2.0 * sharing_cost(costs) + swap_rounds_cost(costs, load, radix_factors(costs.hosts), columns, 1.0 / columns);
    return Prediction{seconds};
  }

  using Compositor::composite;
  Composited composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                       std::span<const int> shown_by) override {
    return schedule_.run(comm, layer, tiles, {}, shown_by);
  }

 private:
  SharedMemorySchedule<Key> schedule_;
};

/// The strategy for colours. The schedule looks after the order itself: where ranks are does not change with it.
template <typename Pixel>
class SharedMemoryBlender final : public Blender<Pixel> {
 public:
  [[nodiscard]] std::string_view name() const override { return "shared-memory"; }
  [[nodiscard]] bool fits(int ranks) const override { return ranks >= 1; }
  [[nodiscard]] bool merges_in_place() const override { return true; }

  Composited blend(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                   std::span<const int> order, std::span<const int> shown_by) override {
    (void)RenumberedCommunicator(comm, order);  // refuses what is no order
    return schedule_.run(comm, layer, tiles, order, shown_by);
  }

 private:
  SharedMemorySchedule<Pixel> schedule_;
};

}  // namespace

Strategy shared_memory_strategy() {
  return {"shared-memory", make_implementation<Compositor, SharedMemory>,
          make_implementation<Blender<Rgba8Premultiplied>, SharedMemoryBlender<Rgba8Premultiplied>>,
          make_implementation<Blender<RgbaPremultiplied>, SharedMemoryBlender<RgbaPremultiplied>>};
}

}  // namespace hpr
