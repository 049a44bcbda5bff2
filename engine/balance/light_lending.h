#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "cluster/transport/work_board.h"
#include "image/tiles.h"
#include "rt/deferred_shader.h"

namespace hpr {

class Communicator;
class Interrupt;

/// Rows of a tile that another rank than its owner lit.
struct LentRows {
  std::size_t tile = 0;
  int first = 0;
  int end = 0;
  int owner = 0;
  int lit_by = 0;

  /// Their place among the pixels of a tile.
  [[nodiscard]] std::size_t first_pixel() const { return static_cast<std::size_t>(first) * kTileSide; }
  [[nodiscard]] std::size_t pixels() const { return static_cast<std::size_t>(end - first) * kTileSide; }
};

/// Lets ranks of a host that have lit their tiles light rows of others' tiles, on demand. A rank offers its tiles with
/// their keys on a WorkBoard, and draws from there itself; light that others made of them comes back to it once all are
/// lit. So who owns a tile stays as it is, and so do the bits.
class LightLending {
 public:
  /// What is lent at a time: tiles of one layout, so many samples of each together.
  struct Round {
    std::size_t tiles = 0;
    std::size_t samples = 1;
  };
  /// Collective, before any rank draws: ends the last round. False, on all ranks alike, where nothing can be lent in
  /// this one, as the hosts have no shared memory for it.
  [[nodiscard]] bool start(Communicator& comm, const Round& round);

  /// What a rank has to light.
  struct Work {
    std::span<const ShadedSample> samples;
    std::span<const std::size_t> owned;
    /// Per tile of the layout about what it costs; empty: as many pixels as have keys tell.
    std::span<const double> costs = {};
    int threads = 1;
    Interrupt* interrupt = nullptr;  ///< of this rank; raised on any rank it ends the light of all
    /// How long a rank that is done waits for others to offer what they have. Then it goes on to where all ranks meet,
    /// which has the limit of every wait.
    std::chrono::milliseconds patience{5000};
  };
  /// Collective, after start(): lights all ranks' tiles, this one's into the output of its samples. False on all ranks
  /// where it was interrupted: then there is no light. Only where all ranks are in sight may there be an interrupt.
  [[nodiscard]] bool shade(Communicator& comm, DeferredShader& shader, const Work& work);

  /// Whether all ranks share memory.
  [[nodiscard]] bool sees_all(const Communicator& comm) const;
  /// How long this rank took in the last round to send and receive light that was made for others, once it had none
  /// left to make: mostly waiting for the last one.
  [[nodiscard]] double return_ms() const { return return_ms_; }
  /// What others lit of this rank's tiles in the last round.
  [[nodiscard]] std::span<const LentRows> lent() const { return lent_; }

 private:
  class Drawing;

  /// Rows of a tile as they stand on the board, in the order in which they are drawn.
  struct Offer {
    std::uint32_t tile = 0;
    std::uint16_t first = 0;
    std::uint16_t end = 0;
    std::uint32_t slot = 0;  ///< where the tile's keys and mask stand
    std::uint32_t has_mask = 0;
  };
  [[nodiscard]] std::size_t slot_bytes() const;
  [[nodiscard]] std::size_t slots() const;
  [[nodiscard]] std::size_t max_offers() const;
  [[nodiscard]] Offer offer_of(int rank, std::uint64_t piece) const;
  [[nodiscard]] std::vector<ShadedPart> publish(const Work& work, bool whole_tiles);
  void write_slot(const Work& work, std::size_t slot, std::size_t tile);
  void return_light(Communicator& comm, std::span<const ShadedSample> samples, std::span<const LentRows> all);

  std::optional<WorkBoard> board_;
  Round round_;
  int ranks_ = 1;
  bool is_impossible_ = false;
  double return_ms_ = 0.0;
  std::vector<LentRows> lent_;
};

}  // namespace hpr
