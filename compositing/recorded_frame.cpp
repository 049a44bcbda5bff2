#include "compositing/recorded_frame.h"

#include <algorithm>
#include <numeric>

#include "cluster/recording_communicator.h"
#include "compositing/assembly.h"

namespace hpr {
namespace {

/// 64 tiles: a power of two, so that halves of halves stay whole.
constexpr Size kFrame{512, 512};

void draw_everywhere(TileLayer<Key>& layer, int rank) {
  for (std::size_t tile = 0; tile < layer.tiles(); ++tile) {
    layer.set_active(tile);
    std::ranges::fill(layer.tile(tile), make_key(0.5F, static_cast<std::uint32_t>(rank)));
  }
}

}  // namespace

RecordedFrame record_frame(const std::function<std::unique_ptr<Compositor>()>& make, const LocalRanks& ranks) {
  const FrameLayout layout({kFrame});
  std::vector<std::size_t> tiles(layout.tiles());
  std::iota(tiles.begin(), tiles.end(), std::size_t{0});
  const std::vector<int> shown_by{0};
  const auto size = static_cast<std::size_t>(ranks.size);
  std::vector<std::vector<Deed>> composite(size);
  std::vector<std::vector<Deed>> collect(size);

  run_local_ranks(ranks, [&](Communicator& inner) {
    RecordingCommunicator comm(inner);
    const auto own = static_cast<std::size_t>(comm.rank());
    const auto compositor = make();
    const bool in_place = compositor->merges_in_place();
    TileLayer<Key> layer =
        in_place ? TileLayer<Key>(layout, comm.share(TileLayer<Key>::bytes_for(layout))) : TileLayer<Key>(layout);
    Assembler assembler;
    for (int frame = 0; frame < 2; ++frame) {
      draw_everywhere(layer, comm.rank());
      (void)comm.take_deeds();
      const Composited mine = compositor->composite(comm, layer, tiles, shown_by);
      composite[own] = comm.take_deeds();
      if (!mine.assembled) assembler.assemble(comm, layer, mine.tiles, shown_by);
      collect[own] = comm.take_deeds();
    }
  });
  return {tiles.size(), schedule_of(composite), schedule_of(collect)};
}

}  // namespace hpr
