#pragma once

#include <cstddef>
#include <span>

namespace hpr {

/// Memory of every rank of a communicator, of which a rank sees its own and that of the ranks on its host. Layers that
/// live in it can be merged where they lie. Whoever reads what another rank wrote needs a message between the two, or a
/// meeting of all, first.
class PeerMemory {
 public:
  virtual ~PeerMemory() = default;

  /// The memory of this rank.
  [[nodiscard]] virtual std::span<std::byte> mine() = 0;
  /// The memory of `rank`; empty when that runs on another host.
  [[nodiscard]] virtual std::span<std::byte> of(int rank) = 0;
  /// Collective over the ranks of this host: returns when all of them have called it. Waits asleep, so that ranks that
  /// still have work find a free core. Throws Error (Hang) past the communicator's time limit.
  virtual void meet() = 0;
};

/// Whether all ranks of the communicator that `memory` came from, which has so many, run on this host.
[[nodiscard]] inline bool shared_by_all(PeerMemory& memory, int ranks) {
  for (int rank = 0; rank < ranks; ++rank) {
    if (memory.of(rank).empty()) return false;
  }
  return true;
}

}  // namespace hpr
