#pragma once

#include "compositing/compositor.h"

namespace hpr {

/// The maximum over all ranks by the communicator's own reduction (MPI_Ireduce with MPI_MAX under MPI) to rank 0. It
/// uses neither our merge kernel nor our tile codec, so it is an oracle for both.
///
/// Cost: what the MPI library makes of a reduction of N keys; empty tiles cost as much as full ones.
class MpiReduce final : public Compositor {
 public:
  [[nodiscard]] std::string_view name() const override { return "mpi-reduce"; }
  using Compositor::composite;
  Composited composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                       std::span<const int> shown_by) override;
  [[nodiscard]] std::optional<Prediction> predict(const Costs& costs, const Load& load) const override;
};

}  // namespace hpr
