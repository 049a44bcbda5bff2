#pragma once

#include "compositing/compositor.h"
#include "compositing/tile_codec.h"

namespace hpr {

/// The messages of the serial strategy, for any kind of pixel.
template <typename Pixel>
class SerialSchedule {
 public:
  Composited run(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                 std::span<const int> shown_by);

 private:
  TileMessage given_;
  PieceMerger<Pixel> merger_;
};

/// Every rank sends its layer to rank 0, which merges them as they come: the floor any other strategy must beat.
/// Known as direct send to one rank, and as the naive sort-last of Molnar, Cox, Ellsworth and Fuchs, "A Sorting
/// Classification of Parallel Rendering", 1994.
///
/// Cost: rank 0 receives and merges (P - 1) N keys one after the other; the others send one message of N keys.
class Serial final : public Compositor {
 public:
  [[nodiscard]] std::string_view name() const override { return "serial"; }
  using Compositor::composite;
  Composited composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                       std::span<const int> shown_by) override;
  [[nodiscard]] std::optional<Prediction> predict(const Costs& costs, const Load& load) const override;

 private:
  SerialSchedule<Key> schedule_;
};

}  // namespace hpr
