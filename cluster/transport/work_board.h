#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "core/peer_memory.h"

namespace hpr {

class Communicator;

/// Lists of work, one of each rank, from which any rank of the same host draws: a counter per list in memory that they
/// share says what is drawn next, so that each piece is drawn once. What the pieces are stands in the payload beside
/// it.
///
/// Work is done in rounds, whose numbers ascend and are agreed on before anybody publishes (next_round()). Nobody ever
/// waits for another one here.
class WorkBoard {
 public:
  /// Collective: the board has `bytes` of payload for each rank. Throws Error (Limit) as Communicator::share() does.
  WorkBoard(Communicator& comm, std::size_t bytes);

  /// Collective: ends the last round, for all ranks, and begins one.
  void next_round(Communicator& comm);

  [[nodiscard]] std::size_t bytes() const;
  /// This rank's payload, which is to be written between next_round() and publish() only.
  [[nodiscard]] std::span<std::byte> payload();
  /// Offers `count` pieces of work, numbered from 0, to all ranks of this host, this one too.
  void publish(std::uint64_t count);

  /// Whether `rank` is on this host.
  [[nodiscard]] bool sees(int rank) const;
  /// Whether `rank` has published in this round. From then on its payload may be read until the round ends.
  [[nodiscard]] bool is_published(int rank) const;
  [[nodiscard]] std::span<const std::byte> payload_of(int rank) const;
  /// How many of a rank's pieces nobody has drawn; 0 before it has published.
  [[nodiscard]] std::uint64_t remaining(int rank) const;
  /// From any thread: a piece of that rank's list that is the caller's alone; none once all are drawn, or before it has
  /// published.
  [[nodiscard]] std::optional<std::uint64_t> draw(int rank);

  /// Tells all ranks of this host to end the round, from any thread.
  void raise();
  /// Whether any of them did.
  [[nodiscard]] bool is_raised() const;

 private:
  struct Head;
  [[nodiscard]] Head& head_of(int rank) const;

  std::shared_ptr<PeerMemory> memory_;
  int rank_;
  int ranks_;
  std::uint64_t round_ = 0;
};

}  // namespace hpr
