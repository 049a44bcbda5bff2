#pragma once

#include <compare>
#include <cstddef>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "cluster/transport/communicator_wrappers.h"

namespace hpr {

/// One message, with the segments that follow it.
struct Transfer {
  int round = 0;
  int from = 0;
  int to = 0;
  std::size_t bytes = 0;
  bool reduced = false;  ///< part of a reduce_max: what the communicator sends for it is its own business

  auto operator<=>(const Transfer&) const = default;  // NOLINT(modernize-use-nullptr): clang-tidy 14 sees a 0 in it
};

/// A barrier between ranks of one host.
struct Barrier {
  int round = 0;
  std::vector<int> ranks;

  auto operator<=>(const Barrier&) const = default;  // NOLINT(modernize-use-nullptr): as above
};

/// Pixels merged or copied without a message, by ranks that share memory; which of them did how much is chance.
struct InPlaceWork {
  int round = 0;
  std::vector<int> ranks;
  std::size_t bytes = 0;

  auto operator<=>(const InPlaceWork&) const = default;  // NOLINT(modernize-use-nullptr): as above
};

/// Who sent what to whom, in which round. Rounds are counted from 0 and follow from what waited for what, not from the
/// clock: a rank's calls are in rounds of their own, and a message is in the first round in which both its sender and
/// its receiver had reached it. Everything is in order of rounds, then ranks.
struct Schedule {
  int ranks = 1;
  int rounds = 0;
  std::vector<Transfer> transfers;
  std::vector<Barrier> barriers;
  std::vector<InPlaceWork> works;
};

/// Names a message among all of a run: number `number` of those that went from one rank to another in `channel`.
struct MessageId {
  std::vector<int> channel;
  int from = 0;
  int to = 0;
  int number = 0;

  auto operator<=>(const MessageId&) const = default;  // NOLINT(modernize-use-nullptr): as above
};

/// What one rank did in one call of its communicator.
struct TraceEvent {
  enum class Kind { Messages, Reduction, Barrier, InPlaceWork };
  struct Sent {
    MessageId id;
    std::size_t bytes = 0;
  };

  Kind kind = Kind::Messages;
  std::vector<Sent> sent;           ///< without waiting
  std::vector<MessageId> received;  ///< waited for
  std::vector<int> ranks;           ///< of the barrier or the work
  std::size_t bytes = 0;            ///< of the work
};

/// The schedule that the recorded events make. `events`: per rank, in the order of its calls. Every message received
/// must have been sent.
[[nodiscard]] Schedule schedule_of(std::span<const std::vector<TraceEvent>> events);

/// Records what this rank sends, receives and merges in place, and its barriers, in the order of its calls: the events
/// of all ranks make a Schedule. It adds nothing to the messages. Calls of a subset are recorded here too, by the ranks
/// of this communicator.
class RecordingCommunicator final : public ForwardingCommunicator {
 public:
  explicit RecordingCommunicator(Communicator& inner);

  /// The events recorded since the last call. All messages sent until now must have been received before ranks call it.
  [[nodiscard]] std::vector<TraceEvent> take_events() { return std::exchange(log_->events, {}); }

  void send(std::span<const std::byte> message, int to) override;
  void receive(std::span<std::byte> message, int from) override;
  [[nodiscard]] std::vector<std::byte> receive(int from) override;
  void exchange(std::span<const Outgoing> out, std::span<const int> from, const Arrived& arrived) override;
  void reduce_max(std::span<std::uint64_t> values, int root) override;
  [[nodiscard]] std::unique_ptr<Communicator> subset(std::span<const int> members) override;
  [[nodiscard]] std::shared_ptr<PeerMemory> share(std::size_t bytes) override;
  void worked(std::size_t bytes) override;

 private:
  class Memory;
  using Channel = std::vector<int>;

  /// The record of one rank, for a communicator and its subsets.
  struct Log {
    std::vector<TraceEvent> events;
    std::map<std::pair<Channel, std::pair<int, int>>, int> numbers;  ///< messages counted per route
    std::vector<int> host;                                           ///< the ranks of the last barrier
    bool exchanging = false;                                         ///< segments and merges belong to a message
  };

  RecordingCommunicator(std::unique_ptr<Communicator> part, RecordingCommunicator& whole, Channel channel,
                        std::vector<int> worlds);

  [[nodiscard]] int world(int rank) const { return worlds_[static_cast<std::size_t>(rank)]; }
  [[nodiscard]] MessageId next_id(const Channel& channel, int from, int to);
  void note_received(int from);

  Log own_;
  Log* log_;
  Channel channel_;  ///< empty for the whole; of a subset its members, -1 and how many of just these came before
  std::vector<int> worlds_;  ///< per rank here, its rank in the whole
  std::map<Channel, int> subsets_made_;
  int shared_blocks_ = 0;
};

}  // namespace hpr
