#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "cluster/transport/communicator_wrappers.h"
#include "compositing/assembly.h"
#include "compositing/compositor.h"
#include "core/timing.h"
#include "image/image.h"
#include "tools/compare/compare.h"

/// Measuring one strategy on one frame, whatever its pixels are.
namespace hpr {

/// What one rank measured in one frame.
struct Sample {
  double composite_ms = 0.0;
  double collect_ms = 0.0;
  std::uint64_t bytes = 0;
  std::uint64_t messages = 0;
};

/// `values` is not empty.
[[nodiscard]] Spread spread_of(std::vector<double> values);

/// The screens side by side.
template <typename Pixel>
[[nodiscard]] Image<Pixel> wall_image(const TileLayer<Pixel>& layer, const CompareInput& input) {
  const Size screen = input.screen;
  Image<Pixel> wall(Size{screen.width * input.grid.width, screen.height * input.grid.height});
  for (std::size_t i = 0; i < layer.layout().screens(); ++i) {
    const int left = static_cast<int>(i) % input.grid.width * screen.width;
    const int top = static_cast<int>(i) / input.grid.width * screen.height;
    paste(to_image(layer, i), left, top, wall);
  }
  return wall;
}

/// Collective. Where all ranks are on one host they wait asleep, so that those that come late find a core.
void wait_for_all(Communicator& comm, PeerMemory* peers);

/// Collective: one frame of one strategy, from the ranks' layers to the whole frame on rank 0. `composite` is given who
/// shows which screen.
template <typename Pixel>
Sample measure_frame(CountingCommunicator& comm, Assembler& assembler, TileLayer<Pixel>& layer, PeerMemory* peers,
                     const std::function<Composited(std::span<const int>)>& composite) {
  const std::vector<int> shown_by(layer.layout().screens(), 0);
  wait_for_all(comm, peers);
  const std::size_t bytes_before = comm.bytes_sent();
  const std::size_t messages_before = comm.messages_sent();
  const double start = comm.seconds();
  const Composited mine = [&] {
    const trace::Span span("composite");
    return composite(shown_by);
  }();
  const double composited = comm.seconds();
  const trace::Span span("collect");
  if (!mine.assembled) assembler.assemble(comm, layer, mine.tiles, shown_by);
  const Sample sample{(composited - start) * 1e3, (comm.seconds() - composited) * 1e3, comm.bytes_sent() - bytes_before,
                      comm.messages_sent() - messages_before};
  wait_for_all(comm, peers);  // ranks that are done must not take the cores of those that are still timed
  return sample;
}

/// The memory frames are composited in: one where ranks of one host can merge in place, for the strategies that do so,
/// and one of this rank's own, which messages leave faster (it has large pages).
template <typename Pixel>
class WorkingLayers {
 public:
  /// Collective. `in_place`: any strategy merges in place.
  WorkingLayers(Communicator& comm, const FrameLayout& layout, bool in_place) : own_(layout) {
    if (in_place) shared_ = TileLayer<Pixel>(layout, comm.share(TileLayer<Pixel>::bytes_for(layout)));
  }

  [[nodiscard]] TileLayer<Pixel>& of(bool merges_in_place) { return merges_in_place ? shared_ : own_; }
  /// For meetings; null where no strategy merges in place.
  [[nodiscard]] PeerMemory* peers() const { return shared_.peers(); }

 private:
  TileLayer<Pixel> own_;
  TileLayer<Pixel> shared_;
};

/// Collective: on rank 0 every rank's samples, one per frame.
[[nodiscard]] std::vector<std::vector<Sample>> gather_samples(Communicator& comm, const std::vector<Sample>& samples);

/// Fills in the times and what was sent. `ranks`: per rank its samples, one per frame.
void summarize(const std::vector<std::vector<Sample>>& ranks, CompareRun& run);

}  // namespace hpr
