#pragma once

#include <optional>
#include <span>
#include <vector>

#include "compositing/compositor.h"
#include "compositing/tile_codec.h"

namespace hpr {

/// Every rank owns a piece of the frame and gets it from all others at once. Hsu, "Segmented Ray Casting for Data
/// Parallel Volume Rendering", 1993; Neumann, "Communication Costs for Parallel Volume-Rendering Algorithms", 1994.
///
/// Where several ranks show screens with about as much on them each, the pieces are what each one shows, and nothing is
/// left to assemble. A rank sends only to owners of tiles it has drawn into.
///
/// Cost: one round; at most P - 1 messages and N (1 - 1/P) keys sent per rank, after ceil(log2 P) messages of one bit
/// per tile and rank.
template <typename Pixel>
class DirectSend {
 public:
  [[nodiscard]] std::optional<Prediction> predict(const Costs& costs, const Load& load) const;
  Composited run(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                 std::span<const int> shown_by);

 private:
  std::vector<TileMessage> sent_;  ///< per rank
  PieceMerger<Pixel> merger_;
};

}  // namespace hpr
