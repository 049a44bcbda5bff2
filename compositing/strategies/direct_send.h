#pragma once

#include "compositing/activity.h"
#include "compositing/compositor.h"
#include "compositing/tile_codec.h"

namespace hpr {

/// The messages of direct send, for any kind of pixel.
template <typename Pixel>
class DirectSendSchedule {
 public:
  Composited run(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                 std::span<const int> shown_by);

 private:
  std::vector<TileMessage> given_;  ///< per rank
  PieceMerger<Pixel> merger_;
};

/// Every rank owns a piece of the frame and gets it from all others at once. Hsu, "Segmented Ray Casting for Data
/// Parallel Volume Rendering", 1993; Neumann, "Communication Costs for Parallel Volume-Rendering Algorithms", 1994.
///
/// Where several ranks show screens with about as much on them each, the pieces are what each one shows, and nothing is
/// left to assemble. A rank sends only to owners of tiles it has drawn into.
///
/// Cost: one round; at most P - 1 messages and N (1 - 1/P) keys sent per rank, after ceil(log2 P) messages of one bit
/// per tile and rank.
class DirectSend final : public Compositor {
 public:
  [[nodiscard]] std::string_view name() const override { return "direct-send"; }
  using Compositor::composite;
  Composited composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                       std::span<const int> shown_by) override;
  [[nodiscard]] std::optional<Prediction> predict(const Costs& costs, const Load& load) const override;

 private:
  DirectSendSchedule<Key> schedule_;
};

}  // namespace hpr
