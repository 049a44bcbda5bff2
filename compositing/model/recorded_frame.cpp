#include "compositing/model/recorded_frame.h"

#include "cluster/transport/schedule.h"
#include "compositing/assembly.h"
#include "compositing/model/synthetic.h"

namespace hpr {
namespace {

/// 64 tiles: a power of two, so that halves of halves stay whole.
constexpr Size kFrame{512, 512};

}  // namespace

RecordedFrame record_frame(const std::function<std::unique_ptr<Compositor>()>& make, const LocalRanks& ranks) {
  const FrameLayout layout({kFrame});
  const std::vector<std::size_t> tiles = all_tiles(layout);
  const std::vector<int> shown_by{0};
  const auto size = static_cast<std::size_t>(ranks.size);
  std::vector<std::vector<TraceEvent>> composite(size);
  std::vector<std::vector<TraceEvent>> collect(size);

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
      (void)comm.take_events();
      const Composited mine = compositor->composite(comm, layer, tiles, shown_by);
      composite[own] = comm.take_events();
      if (!mine.assembled) assembler.assemble(comm, layer, mine.tiles, shown_by);
      collect[own] = comm.take_events();
    }
  });
  return {tiles.size(), schedule_of(composite), schedule_of(collect)};
}

}  // namespace hpr
