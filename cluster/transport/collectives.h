#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "cluster/transport/communicator.h"
#include "core/error.h"

/// Collectives over any Communicator, built from its messages: every rank of `comm` calls them together.
namespace hpr {

/// `bytes` of `root` reach all ranks, along a binomial tree: ceil(log2 P) rounds.
void broadcast(Communicator& comm, std::vector<std::byte>& bytes, int root = 0);

/// Returns when all ranks have called it.
void barrier(Communicator& comm);

/// Each rank's bytes, in order of rank, on `root`; empty elsewhere.
[[nodiscard]] std::vector<std::vector<std::byte>> gather(Communicator& comm, std::span<const std::byte> bytes,
                                                         int root = 0);

/// Each rank's bytes, in order of rank, on every rank, in ceil(log2 P) rounds of one message each: Bruck, Ho, Kipnis,
/// Upfal and Weathersby, "Efficient Algorithms for All-to-All Communications in Multiport Message-Passing Systems",
/// 1997; each part brings its size along.
[[nodiscard]] std::vector<std::vector<std::byte>> all_gather(Communicator& comm, std::span<const std::byte> bytes);

/// In one round of messages: parts[i] reaches rank i. Returns what each rank had for this one, in order of rank.
[[nodiscard]] std::vector<std::vector<std::byte>> all_to_all(Communicator& comm,
                                                             std::vector<std::vector<std::byte>> parts);

/// For each rank, the first rank of the host with which it shares `memory`.
[[nodiscard]] std::vector<int> hosts_of(Communicator& comm, PeerMemory& memory);

/// Each rank's value, in order of rank, on every rank.
template <typename Value>
[[nodiscard]] std::vector<Value> all_gather_value(Communicator& comm, const Value& value) {
  static_assert(std::is_trivially_copyable_v<Value>);
  const auto parts = all_gather(comm, std::as_bytes(std::span(&value, 1)));
  std::vector<Value> values(parts.size());
  for (std::size_t i = 0; i < parts.size(); ++i) {
    HPR_CHECK(parts[i].size() == sizeof(Value));
    std::memcpy(&values[i], parts[i].data(), sizeof(Value));
  }
  return values;
}

/// Each rank's values, as many as it has, in order of rank, on every rank.
template <typename Value>
[[nodiscard]] std::vector<std::vector<Value>> all_gather_lists(Communicator& comm, std::span<const Value> mine) {
  static_assert(std::is_trivially_copyable_v<Value>);
  std::vector<std::vector<Value>> lists;
  for (const auto& bytes : all_gather(comm, std::as_bytes(mine))) {
    HPR_CHECK(bytes.size() % sizeof(Value) == 0);
    lists.emplace_back(bytes.size() / sizeof(Value));
    if (!bytes.empty()) std::memcpy(lists.back().data(), bytes.data(), bytes.size());
  }
  return lists;
}

/// The text of rank 0, on every rank.
[[nodiscard]] std::string broadcast_text(Communicator& comm, const std::string& text);

/// Each rank's text, in order of rank, on every rank.
[[nodiscard]] std::vector<std::string> all_gather_texts(Communicator& comm, const std::string& text);

/// An Error that all ranks of a communicator throw alike, at the same place of what they do together: they may go on
/// together.
class AgreedError : public Error {
 public:
  using Error::Error;
  explicit AgreedError(const Error& error) : Error(error) {}
};

/// Runs `work`; what it throws, as an Error: Limit where memory ran out, Internal where it is none.
[[nodiscard]] std::optional<Error> failure_of(const std::function<void()>& work);

/// Runs `work` on rank 0 alone and returns its bytes on every rank; an Error it throws is thrown on every rank
/// (AgreedError), so that no rank waits for one that gave up.
[[nodiscard]] std::vector<std::byte> on_root(Communicator& comm, const std::function<std::vector<std::byte>()>& work);

/// Runs `check` on rank 0 alone; when it fails, every rank throws its Error (AgreedError).
void check_on_root(Communicator& comm, const std::function<void()>& check);

/// Runs `work` on every rank; when it fails on any, all throw the lowest rank's Error (AgreedError).
void agree_on_failure(Communicator& comm, const std::function<void()>& work);

}  // namespace hpr
