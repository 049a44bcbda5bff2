#pragma once

#include <compare>
#include <cstddef>
#include <span>
#include <vector>

namespace hpr {

/// One message, with the bodies that follow it.
struct Transfer {
  int round = 0;
  int from = 0;
  int to = 0;
  std::size_t bytes = 0;
  bool reduced = false;  ///< part of a reduce_max: what the communicator sends for it is its own business

  auto operator<=>(const Transfer&) const = default;  // NOLINT(modernize-use-nullptr): clang-tidy 14 sees a 0 in it
};

/// Ranks of one host that wait for each other.
struct Gathering {
  int round = 0;
  std::vector<int> ranks;

  auto operator<=>(const Gathering&) const = default;  // NOLINT(modernize-use-nullptr): as above
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
/// its receiver had got to it. Everything is in order of rounds, then ranks.
struct Schedule {
  int ranks = 1;
  int rounds = 0;
  std::vector<Transfer> transfers;
  std::vector<Gathering> gatherings;
  std::vector<InPlaceWork> works;
};

/// Names a message among all of a run: number `number` of those that went from one rank to another in `channel`.
struct Ticket {
  std::vector<int> channel;
  int from = 0;
  int to = 0;
  int number = 0;

  auto operator<=>(const Ticket&) const = default;  // NOLINT(modernize-use-nullptr): as above
};

/// What one rank did in one call, as it saw it.
struct Deed {
  enum class Kind { Messages, Reduction, Gathering, InPlaceWork };
  struct Given {
    Ticket ticket;
    std::size_t bytes = 0;
  };

  Kind kind = Kind::Messages;
  std::vector<Given> given;   ///< without waiting
  std::vector<Ticket> taken;  ///< waited for
  std::vector<int> ranks;     ///< of the gathering or the work
  std::size_t bytes = 0;      ///< of the work
};

/// `deeds`: of each rank, in its order. What is taken must have been given.
[[nodiscard]] Schedule schedule_of(std::span<const std::vector<Deed>> deeds);

}  // namespace hpr
