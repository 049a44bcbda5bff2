#pragma once

#include "compositing/compositor.h"
#include "compositing/tile_codec.h"

namespace hpr {

/// A binary tree with rank 0 at its root, as in Shaw, Green and Schaeffer, "A VLSI Architecture for Image Composition",
/// 1988: in round k the ranks that differ in bit k pair off, the higher one hands its layer down and is done.
///
/// Cost: ceil(log2 P) rounds of N keys. A rank sends at most one message; rank 0 receives one per round. Half of the
/// ranks that are left fall idle in each round, which binary swap avoids.
class Tree final : public Compositor {
 public:
  [[nodiscard]] std::string_view name() const override { return "tree"; }
  using Compositor::composite;
  Composited composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                       std::span<const int> shown_by) override;
  [[nodiscard]] std::optional<Prediction> predict(const Costs& costs, const Load& load) const override;

 private:
  TileMessage given_;
  TileReader reader_;
};

}  // namespace hpr
