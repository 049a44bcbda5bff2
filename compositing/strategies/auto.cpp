#include "compositing/strategies/auto.h"

#include <algorithm>

#include "core/error.h"

namespace hpr {
namespace {

constexpr int kFramesBetweenLooks = 16;

}  // namespace

std::string Auto::best(const Costs& costs, const Load& load, bool collects, bool in_place) {
  std::string name;
  double least = 0.0;
  for (const auto& compositor : all_compositors()) {
    if (compositor->name() == "auto" || !compositor->fits(costs.ranks)) continue;
    if (compositor->merges_in_place() && !in_place) continue;
    const auto prediction = compositor->predict(costs, load);
    if (!prediction) continue;
    const double seconds = collects ? prediction->collected(costs, load) : prediction->composite;
    if (!name.empty() && seconds >= least) continue;
    name = compositor->name();
    least = seconds;
  }
  HPR_CHECK(!name.empty());
  return name;
}

std::optional<Prediction> Auto::predict(const Costs& costs, const Load& load) const {
  // As it chooses: without looking at costs where all ranks share memory.
  const bool all_in_place = costs.hosts == 1 && costs.read_byte.has_value();
  const std::string name = all_in_place ? "shared-memory" : best(costs, load, true, true);
  return make_compositor(name)->predict(costs, load);
}

void Auto::choose(Communicator& comm, const TileLayer<Key>& layer, std::span<const std::size_t> tiles, bool collects) {
  const bool in_place = layer.peers() != nullptr;
  const bool is_new = comm_ != &comm || in_place_ != in_place;
  if (is_new) {
    used_.clear();
    chosen_ = nullptr;
    frames_ = 0;
    comm_ = &comm;
    in_place_ = in_place;
    all_in_place_ = in_place && shared_by_all(*layer.peers(), comm.size());
    if (!all_in_place_) costs_ = measure_costs(comm);
  }
  if (!is_new && (all_in_place_ || ++frames_ < kFramesBetweenLooks)) return;
  frames_ = 0;
  const std::string name = all_in_place_ ? "shared-memory" : best_for(comm, layer, tiles, collects);
  auto same = std::ranges::find(used_, name, [](const auto& compositor) { return compositor->name(); });
  if (same == used_.end()) same = used_.insert(same, make_compositor(name));
  chosen_ = same->get();
}

std::string Auto::best_for(Communicator& comm, const TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                           bool collects) const {
  const Load load = share_load(comm, layer, tiles);
  return best(costs_.with_packed(load.packed_share), load, collects, in_place_);
}

Composited Auto::composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                           std::span<const int> shown_by) {
  choose(comm, layer, tiles, !shown_by.empty());
  return chosen_->composite(comm, layer, tiles, shown_by);
}

}  // namespace hpr
