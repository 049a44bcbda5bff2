#include "cluster/transport/work_board.h"

#include <algorithm>
#include <atomic>

#include "cluster/transport/collectives.h"
#include "cluster/transport/communicator.h"
#include "core/error.h"

namespace hpr {

/// What stands before a rank's payload. Zeros are a board of round 0, which nobody uses. Every member is read and
/// written as an atomic only.
struct WorkBoard::Head {
  std::uint64_t round;
  std::uint64_t count;
  std::uint64_t raised;  ///< the round that is to end
  std::uint64_t next;
  std::uint64_t unused[4];  ///< so that the payload starts at a cache line where the memory does
};

WorkBoard::WorkBoard(Communicator& comm, std::size_t bytes)
    : memory_(comm.share(sizeof(Head) + bytes)), rank_(comm.rank()), ranks_(comm.size()) {
  static_assert(std::atomic_ref<std::uint64_t>::is_always_lock_free);
}

WorkBoard::Head& WorkBoard::head_of(int rank) const {
  return *reinterpret_cast<Head*>(memory_->of(rank).data());
}

void WorkBoard::next_round(Communicator& comm) {
  // The largest, as a rank that failed in between may have missed some.
  round_ = std::ranges::max(all_gather_value(comm, round_)) + 1;
}

std::size_t WorkBoard::bytes() const {
  return memory_->mine().size() - sizeof(Head);
}

std::span<std::byte> WorkBoard::payload() {
  return memory_->mine().subspan(sizeof(Head));
}

std::span<const std::byte> WorkBoard::payload_of(int rank) const {
  return memory_->of(rank).subspan(sizeof(Head));
}

bool WorkBoard::sees(int rank) const {
  return !memory_->of(rank).empty();
}

void WorkBoard::publish(std::uint64_t count) {
  Head& head = head_of(rank_);
  std::atomic_ref(head.count).store(count, std::memory_order_relaxed);
  std::atomic_ref(head.next).store(0, std::memory_order_relaxed);
  std::atomic_ref(head.round).store(round_, std::memory_order_release);
}

bool WorkBoard::is_published(int rank) const {
  return std::atomic_ref(head_of(rank).round).load(std::memory_order_acquire) == round_;
}

std::uint64_t WorkBoard::remaining(int rank) const {
  if (!is_published(rank)) return 0;
  const std::uint64_t count = std::atomic_ref(head_of(rank).count).load(std::memory_order_relaxed);
  return count - std::min(count, std::atomic_ref(head_of(rank).next).load(std::memory_order_relaxed));
}

std::optional<std::uint64_t> WorkBoard::draw(int rank) {
  if (remaining(rank) == 0) return std::nullopt;  // so that the counter cannot run on for ever
  const std::uint64_t piece = std::atomic_ref(head_of(rank).next).fetch_add(1, std::memory_order_relaxed);
  if (piece >= std::atomic_ref(head_of(rank).count).load(std::memory_order_relaxed)) return std::nullopt;
  return piece;
}

void WorkBoard::raise() {
  for (int rank = 0; rank < ranks_; ++rank) {
    if (sees(rank)) std::atomic_ref(head_of(rank).raised).store(round_, std::memory_order_relaxed);
  }
}

bool WorkBoard::is_raised() const {
  return std::atomic_ref(head_of(rank_).raised).load(std::memory_order_relaxed) == round_;
}

}  // namespace hpr
