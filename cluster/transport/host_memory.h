#pragma once

#include <chrono>
#include <cstddef>
#include <memory>
#include <span>

#include "cluster/transport/communicator.h"

namespace hpr {

/// One block of memory for all ranks of a host, zeroed. Pages of it take memory once they are written to. Destroying it
/// waits for nobody: the memory lasts until the last rank is done with it.
class HostMemory {
 public:
  /// Collective; `bytes` are the same on all ranks. Where ranks of a host cannot share a block, each rank has one alone
  /// and counts as a host. `time_limit` is that of meet().
  HostMemory(Communicator& comm, std::size_t bytes, std::chrono::nanoseconds time_limit);
  HostMemory(Communicator& comm, std::size_t bytes) : HostMemory(comm, bytes, comm.hang_timeout()) {}
  ~HostMemory();
  HostMemory(const HostMemory&) = delete;
  HostMemory& operator=(const HostMemory&) = delete;

  [[nodiscard]] std::span<std::byte> bytes() const;
  /// How many ranks share the block, and whether this is the first of them.
  [[nodiscard]] int ranks() const { return ranks_; }
  [[nodiscard]] bool is_first() const { return is_first_; }

  /// Collective over the ranks that share the block. Throws Error (Hang) past the time limit.
  void meet();

  /// Gives back the memory of the whole pages of `part`, for all ranks; it is zero then.
  static void release(std::span<std::byte> part);

 private:
  class Block;
  struct Invitation;
  [[nodiscard]] std::shared_ptr<Block> find_block(Communicator& comm, std::size_t bytes);

  std::shared_ptr<Block> block_;
  std::chrono::nanoseconds time_limit_;
  int ranks_ = 1;
  bool is_first_ = true;
};

}  // namespace hpr
