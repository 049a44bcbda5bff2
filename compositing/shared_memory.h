#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "compositing/compositor.h"

namespace hpr {

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
  SharedMemory();
  ~SharedMemory() override;
  [[nodiscard]] std::string_view name() const override { return "shared-memory"; }
  [[nodiscard]] bool merges_in_place() const override { return true; }
  using Compositor::composite;
  Composited composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                       std::span<const int> shown_by) override;
  [[nodiscard]] std::optional<Prediction> predict(const Costs& costs, const Load& load) const override;

 private:
  class Host;
  static void copy_tiles(const TileLayer<Key>& from, TileLayer<Key>& to, std::span<const std::size_t> tiles);

  std::unique_ptr<Host> host_;  ///< of the communicator of the last call
  TileLayer<Key> copy_;         ///< of layers that live elsewhere
};

}  // namespace hpr
