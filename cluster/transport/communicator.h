#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "core/peer_memory.h"

namespace hpr {

/// One message of an exchange, with the segments of payload that follow it: memory that is not copied together and that
/// the receiver reads into wherever it belongs.
struct Outgoing {
  int to = 0;
  std::span<const std::byte> message;
  std::span<const std::span<const std::byte>> segments = {};
};

/// The size of a message and its segments.
[[nodiscard]] inline std::size_t bytes_of(const Outgoing& outgoing) {
  std::size_t bytes = outgoing.message.size();
  for (const auto segment : outgoing.segments) bytes += segment.size();
  return bytes;
}

/// Called with a message that has arrived; the bytes last until the call returns. They start at a multiple of 8. The
/// call takes the message's segments, each by one receive() from that rank, in their order.
using Arrived = std::function<void(int from, std::span<const std::byte> message)>;

/// Point-to-point messages between ranks, of any size. Messages between two ranks arrive in the order sent. No call
/// waits longer than the communicator's time limit: then it throws Error (Hang) that says which rank it waited for. A
/// peer that failed makes calls throw Error (Lost), or ends the whole job.
class Communicator {
 public:
  virtual ~Communicator() = default;

  [[nodiscard]] virtual int rank() const = 0;
  [[nodiscard]] virtual int size() const = 0;
  /// From here on this rank's messages, reductions and meetings in shared memory belong to frame `frame`, those of its
  /// subsets too. Where ranks of different frames meet, the call of one of them throws Error (Internal) with both
  /// numbers: some rank left a frame out, or did one twice.
  virtual void begin_frame(std::uint64_t frame) = 0;

  /// "mpi" or "threads", as reports name it.
  [[nodiscard]] virtual std::string_view transport() const = 0;

  /// Returns once `message` may be reused.
  virtual void send(std::span<const std::byte> message, int to) = 0;

  /// Fills all of `message`. Throws Error (Internal) when the sender sent another number of bytes.
  virtual void receive(std::span<std::byte> message, int from) = 0;

  /// Receives a message whose size only the sender knows.
  [[nodiscard]] virtual std::vector<std::byte> receive(int from) = 0;

  /// One round of messages: sends all of `out` and receives one message from each rank of `from`, all at once, so that
  /// no order of calls among the ranks can deadlock. `arrived` is called for one message after the other in whatever
  /// order they come, while the others are still under way. No rank may stand in `from` twice; several messages to one
  /// rank are taken by as many calls there. Returns when all of `out` may be reused.
  virtual void exchange(std::span<const Outgoing> out, std::span<const int> from, const Arrived& arrived) = 0;

  /// Collective. values[i] of `root` becomes the largest values[i] of all ranks; those of other ranks are scratch
  /// after.
  virtual void reduce_max(std::span<std::uint64_t> values, int root) = 0;

  /// Collective over `members` only (ascending ranks, this one among them): a communicator of just these, in which
  /// members[i] is rank i. Its messages cannot meet this one's. This one must outlive it. Making it
  /// is the one wait without a time limit under MPI.
  [[nodiscard]] virtual std::unique_ptr<Communicator> subset(std::span<const int> members) = 0;

  /// Collective: `bytes` bytes for each rank (the same number on all), zeroed, which the ranks of one host see of each
  /// other. Outlives this communicator's calls, not the communicator. Throws Error (Limit) where the host has too
  /// little shared memory.
  [[nodiscard]] virtual std::shared_ptr<PeerMemory> share(std::size_t bytes) = 0;

  /// How long a wait for another rank may take before it counts as a hang.
  [[nodiscard]] virtual std::chrono::nanoseconds hang_timeout() const = 0;

  /// A clock of this rank, in seconds since some moment: the machine's, or one that models another machine.
  [[nodiscard]] virtual double seconds() const;
  /// Whether that clock is a model. Work must then be shared by rule, not by who is free.
  [[nodiscard]] virtual bool models_time() const { return false; }
  /// Says that this rank has merged or copied `bytes` bytes of pixels, which a modelled clock takes into account.
  virtual void worked(std::size_t bytes) { (void)bytes; }
};

/// Throws Error (Internal) unless `rank`, in frame `frame`, may meet what `from` did in frame `sent_in`.
void check_frame(int rank, std::uint64_t frame, int from, std::uint64_t sent_in);

/// How long a wait for another rank may take before it counts as a hang, unless the user says otherwise.
inline constexpr std::chrono::seconds kHangTimeout{300};

/// Time limits are cut to this, ten years: a deadline further off would overflow the clock and count as passed.
inline constexpr std::chrono::nanoseconds kMaxWait = std::chrono::hours{87600};

inline double Communicator::seconds() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace hpr
