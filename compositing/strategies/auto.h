#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "compositing/compositor.h"
#include "compositing/model/cost_model.h"

namespace hpr {

/// The strategy that predicts the least time for these ranks and this load. On one host that is shared-memory, which
/// reads every pixel once and sends none. Between hosts, and where a host has too little shared memory, the machine is
/// measured at the first frame, and the load looked at anew every so many frames, as views move slowly.
class Auto final : public Compositor {
 public:
  [[nodiscard]] std::string_view name() const override { return "auto"; }
  [[nodiscard]] bool merges_in_place() const override { return true; }
  using Compositor::composite;
  Composited composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                       std::span<const int> shown_by) override;
  [[nodiscard]] std::optional<Prediction> predict(const Costs& costs, const Load& load) const override;
  [[nodiscard]] std::string_view chosen() const override { return chosen_ ? chosen_->name() : name(); }

  /// The name of the strategy that predicts the least; `collects`: to have the frame on one rank; `in_place`: layers
  /// live where strategies that merge in place can do so.
  [[nodiscard]] static std::string best(const Costs& costs, const Load& load, bool collects, bool in_place);

 private:
  void choose(Communicator& comm, const TileLayer<Key>& layer, std::span<const std::size_t> tiles, bool collects);

  [[nodiscard]] std::string best_for(Communicator& comm, const TileLayer<Key>& layer,
                                     std::span<const std::size_t> tiles, bool collects) const;

  Communicator* comm_ = nullptr;  ///< that the costs are of
  bool in_place_ = false;         ///< layers live in shared memory
  bool all_in_place_ = false;     ///< of one host
  Costs costs_;
  int frames_ = 0;  ///< since the last look
  std::vector<std::unique_ptr<Compositor>> used_;
  Compositor* chosen_ = nullptr;
};

}  // namespace hpr
