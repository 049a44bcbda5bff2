#pragma once

#include "compositing/compositor.h"
#include "compositing/tile_codec.h"

namespace hpr {

/// The messages of the tree, for any kind of pixel.
template <typename Pixel>
class TreeSchedule {
 public:
  Composited run(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                 std::span<const int> shown_by);

 private:
  TileMessage given_;
  PieceMerger<Pixel> merger_;
};

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
  TreeSchedule<Key> schedule_;
};

}  // namespace hpr
