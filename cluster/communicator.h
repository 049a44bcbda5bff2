#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

namespace hpr {

/// Point-to-point messages between ranks, of any size. Messages between two ranks arrive in the order sent. No call
/// waits longer than the communicator's time limit: then it throws Error (Hang) that says which rank it waited for. A
/// peer that failed makes calls throw Error (Lost), or ends the whole job.
class Communicator {
 public:
  virtual ~Communicator() = default;

  [[nodiscard]] virtual int rank() const = 0;
  [[nodiscard]] virtual int size() const = 0;
  /// "mpi" or "threads", as reports name it.
  [[nodiscard]] virtual std::string_view transport() const = 0;

  /// Returns once `message` may be reused.
  virtual void send(std::span<const std::byte> message, int to) = 0;

  /// Fills all of `message`. Throws Error (Internal) when the sender sent another number of bytes.
  virtual void receive(std::span<std::byte> message, int from) = 0;

  /// Receives a message whose size only the sender knows.
  [[nodiscard]] virtual std::vector<std::byte> receive(int from) = 0;

  /// Sends and receives at once, so two ranks that exchange cannot deadlock. Both sizes may differ.
  [[nodiscard]] virtual std::vector<std::byte> exchange(std::span<const std::byte> out, int peer) = 0;

  /// Collective. values[i] of `root` becomes the largest values[i] of all ranks; those of other ranks are scratch
  /// after.
  virtual void reduce_max(std::span<std::uint64_t> values, int root) = 0;

  /// Collective over `members` only (ascending ranks, this one among them): a communicator of just these, in which
  /// members[i] is rank i. Its messages cannot meet this one's. This one must outlive it. Making it
  /// is the one wait without a time limit under MPI.
  [[nodiscard]] virtual std::unique_ptr<Communicator> subset(std::span<const int> members) = 0;
};

/// How long a wait for another rank may take before it counts as a hang, unless the user says otherwise.
inline constexpr std::chrono::seconds kHangTimeout{300};

/// Time limits are cut to this, ten years: a deadline further off would overflow the clock and count as passed.
inline constexpr std::chrono::nanoseconds kLongestWait = std::chrono::hours{87600};

}  // namespace hpr
