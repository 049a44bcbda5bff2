#pragma once

#include "compositing/compositor.h"
#include "compositing/tile_codec.h"

namespace hpr {

/// The frame is cut into P pieces, which travel once around the ring of ranks: in each of P - 1 steps a rank hands one
/// piece on to the next rank and merges its own pixels into the one that comes. Known as pipelined or ring compositing
/// (the master's thesis HPR grows out of has it with n - 1 steps), and as the reduce-scatter of ring all-reduce.
///
/// Cost: P - 1 messages and N (1 - 1/P) keys sent per rank, always to the same neighbour; P - 1 steps that wait for
/// each other.
class Ring final : public Compositor {
 public:
  [[nodiscard]] std::string_view name() const override { return "ring"; }
  using Compositor::composite;
  Composited composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                       std::span<const int> shown_by) override;
  [[nodiscard]] std::optional<Prediction> predict(const Costs& costs, const Load& load) const override;

 private:
  TileMessage given_;
  TileReader reader_;
};

}  // namespace hpr
