#pragma once

#include "compositing/compositor.h"

namespace hpr {

/// Ma, Painter, Hansen and Krogh, "Parallel Volume Rendering Using Binary-Swap Compositing", 1994.
///
/// In each of log2 P rounds a rank and its partner halve the tiles they share; each sends the half it gives up and
/// merges the half it keeps. Cost: log2 P messages and N (1 - 1/P) keys sent per rank, to whole tiles. When P is no
/// power of two, the excess ranks first hand their whole layer to a neighbour and end up owning nothing.
class BinarySwap final : public Compositor {
 public:
  [[nodiscard]] std::string_view name() const override { return "binary-swap"; }
  TileRun composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles) const override;
};

}  // namespace hpr
