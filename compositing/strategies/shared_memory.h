#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "compositing/compositor.h"
#include "compositing/strategies/direct_send.h"
#include "compositing/strategies/radix_k.h"

namespace hpr {

/// Which ranks are on which host, and the counter by which those of this host share their work.
class HostRanks;

/// The shared-memory strategy for any kind of pixel.
template <typename Pixel>
class SharedMemorySchedule {
 public:
  SharedMemorySchedule();
  ~SharedMemorySchedule();
  SharedMemorySchedule(const SharedMemorySchedule&) = delete;
  SharedMemorySchedule& operator=(const SharedMemorySchedule&) = delete;

  /// `order`: the ranks from front to back, which only colours ask for; keys have none.
  Composited run(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                 std::span<const int> order, std::span<const int> shown_by);

 private:
  Composited merge_on_host(Communicator& comm, TileLayer<Pixel>& shared, std::span<const std::size_t> tiles,
                           std::span<const int> order, std::span<const int> shown_by);
  Composited merge_between_hosts(TileLayer<Pixel>& shared, const Composited& of_host, std::span<const int> order);

  std::unique_ptr<HostRanks> host_;         ///< of the communicator of the last call
  TileLayer<Pixel> copy_;                   ///< of layers that live elsewhere
  RadixKSchedule<Pixel> between_hosts_;     ///< of a run of the order on each
  DirectSendSchedule<Pixel> out_of_order_;  ///< where the order runs to and fro between hosts
};

/// The ranks of a host merge each other's layers where they lie, without a message: whoever is free takes the next
/// tiles, reads them in all layers and writes the nearest keys into the layer of the rank that is to own them, straight
/// where they are shown when that rank is on this host. Between hosts, the ranks of like number on each host then
/// composite what they own by radix-k: two levels, each as fast as its medium.
///
/// In place when the layers of all ranks live in the memory of `comm`'s share(); else, also on all ranks, through a
/// copy that does.
///
/// Cost on one host: two barriers; every drawn tile is read once and every tile of the result written once, shared
/// among the ranks as they find time, so that ranks that wait for a core hold nobody up.
class SharedMemory final : public Compositor {
 public:
  [[nodiscard]] std::string_view name() const override { return "shared-memory"; }
  [[nodiscard]] bool merges_in_place() const override { return true; }
  using Compositor::composite;
  Composited composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                       std::span<const int> shown_by) override;
  [[nodiscard]] std::optional<Prediction> predict(const Costs& costs, const Load& load) const override;

 private:
  SharedMemorySchedule<Key> schedule_;
};

}  // namespace hpr
