#pragma once

#include "compositing/compositor.h"
#include "compositing/strategies/swap_rounds.h"

namespace hpr {

/// The messages of binary swap, for any kind of pixel.
template <typename Pixel>
class BinarySwapSchedule {
 public:
  Composited run(Communicator& comm, TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                 std::span<const int> shown_by);

 private:
  SwapRounds<Pixel> rounds_;
  TileMessage folded_;
  PieceMerger<Pixel> merger_;
};

/// In each round two ranks swap halves of the run they share, until every rank owns a part of the frame. Ma, Painter,
/// Hansen and Krogh, "Parallel Volume Rendering Using Binary-Swap Compositing", 1994.
///
/// Ranks past the largest power of two first give their whole layer to a neighbour and own nothing after (fold): one
/// message more, where telescoping (Moreland, 2011) would keep them busy at the price of unequal pieces.
///
/// Cost: log2 P rounds; a rank sends N (1 - 1/P) keys, N the frame's. Before them one bit per tile and rank, in
/// ceil(log2 P) messages, by which the halves are cut to hold as much to merge each.
class BinarySwap final : public Compositor {
 public:
  [[nodiscard]] std::string_view name() const override { return "binary-swap"; }
  using Compositor::composite;
  Composited composite(Communicator& comm, TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                       std::span<const int> shown_by) override;
  [[nodiscard]] std::optional<Prediction> predict(const Costs& costs, const Load& load) const override;

 private:
  BinarySwapSchedule<Key> schedule_;
};

}  // namespace hpr
