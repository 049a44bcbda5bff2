#pragma once

#include <functional>
#include <memory>
#include <string_view>

#include "cluster/transport/local_communicator.h"
#include "cluster/transport/schedule.h"
#include "compositing/compositor.h"

namespace hpr {

/// What a strategy really does with one frame, every rank having drawn all of it.
struct RecordedFrame {
  std::size_t tiles = 0;  ///< of the frame
  Schedule composite;
  Schedule collect;  ///< the messages that bring the tiles to rank 0, where the strategy has not put them there itself
};

/// Composites a small frame on threads and collects it on rank 0, as `hpr compare` does: the second frame, so that
/// what a strategy prepares once does not show. The same call gives the same record. `make` makes one rank's compositor
/// that fits `ranks.size`.
[[nodiscard]] RecordedFrame record_frame(const std::function<std::unique_ptr<Compositor>()>& make,
                                         const LocalRanks& ranks);

}  // namespace hpr
