#include <algorithm>

#include "compositing/model/cost_model.h"
#include "compositing/strategies/strategy.h"

namespace hpr {
namespace {

constexpr int kFramesBetweenChoices = 16;

/// The strategy that predicts the least time for these ranks and this load. On one host that is shared-memory, which
/// reads every pixel once and sends none. Between hosts, and where a host has too little shared memory, the machine is
/// measured at the first frame, and the load looked at anew every so many frames, as views move slowly.
class Auto final : public Compositor {
 public:
  [[nodiscard]] std::string_view name() const override { return "auto"; }
  [[nodiscard]] bool merges_in_place() const override { return true; }
  [[nodiscard]] std::string_view chosen() const override { return chosen_ ? chosen_->name() : name(); }

  [[nodiscard]] std::optional<Prediction> predict(const Costs& costs, const Load& load) const override {
    // As it chooses: without looking at costs where all ranks share memory.
    const bool all_in_place = costs.hosts == 1 && costs.read_byte.has_value();
    const std::string name = all_in_place ? "shared-memory" : cheapest_compositor(costs, load, true, true);
    return make_compositor(name)->predict(costs, load);
  }

  using Compositor::composite;
  Composited composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                       std::span<const int> shown_by) override {
    choose(comm, layer, tiles, !shown_by.empty());
    return chosen_->composite(comm, layer, tiles, shown_by);
  }

 private:
  void choose(Communicator& comm, const TileLayer<Key>& layer, std::span<const std::size_t> tiles, bool collects) {
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
    if (!is_new && (all_in_place_ || ++frames_ < kFramesBetweenChoices)) return;
    frames_ = 0;
    const std::string name = all_in_place_ ? "shared-memory" : cheapest_for(comm, layer, tiles, collects);
    auto same = std::ranges::find(used_, name, [](const auto& compositor) { return compositor->name(); });
    if (same == used_.end()) same = used_.insert(same, make_compositor(name));
    chosen_ = same->get();
  }

  [[nodiscard]] std::string cheapest_for(Communicator& comm, const TileLayer<Key>& layer,
                                         std::span<const std::size_t> tiles, bool collects) const {
    const Load load = share_load(comm, layer, tiles);
    return cheapest_compositor(costs_.with_packed(load.packed_fraction), load, collects, in_place_);
  }

  Communicator* comm_ = nullptr;  ///< that the costs are of
  bool in_place_ = false;         ///< layers live in shared memory
  bool all_in_place_ = false;     ///< of one host
  Costs costs_;
  int frames_ = 0;  ///< since the last look
  std::vector<std::unique_ptr<Compositor>> used_;
  Compositor* chosen_ = nullptr;
};

}  // namespace

Strategy auto_strategy() {
  return {"auto", make_implementation<Compositor, Auto>};
}

}  // namespace hpr
