#pragma once

#include "cluster/transport/forwarding_communicator.h"

namespace hpr {

/// Counts what this rank sends: the cost model of a strategy, free of timing noise. A message counts as one with all
/// its bodies; what ranks read of each other's memory does not count. A reduce_max counts as the one
/// message of its values that each rank but the root gives away. What goes through a subset counts here too.
class CountingCommunicator final : public ForwardingCommunicator {
 public:
  explicit CountingCommunicator(Communicator& inner) : ForwardingCommunicator(inner) {}

  [[nodiscard]] std::size_t messages_sent() const { return messages_sent_; }
  [[nodiscard]] std::size_t bytes_sent() const { return bytes_sent_; }

  void send(std::span<const std::byte> message, int to) override {
    count(message.size());
    inner().send(message, to);
  }
  void exchange(std::span<const Outgoing> out, std::span<const int> from, const Arrived& arrived) override {
    for (const Outgoing& outgoing : out) count(bytes_of(outgoing));
    inner().exchange(out, from, arrived);
  }
  void reduce_max(std::span<std::uint64_t> values, int root) override {
    if (rank() != root) count(values.size_bytes());
    inner().reduce_max(values, root);
  }
  [[nodiscard]] std::unique_ptr<Communicator> subset(std::span<const int> members) override {
    return std::unique_ptr<Communicator>(new CountingCommunicator(inner().subset(members), *this));
  }

 private:
  CountingCommunicator(std::unique_ptr<Communicator> part, CountingCommunicator& whole)
      : ForwardingCommunicator(std::move(part)), whole_(&whole) {}

  void count(std::size_t bytes) {
    ++messages_sent_;
    bytes_sent_ += bytes;
    if (whole_ != nullptr) whole_->count(bytes);
  }

  CountingCommunicator* whole_ = nullptr;  ///< what this one is a subset of
  std::size_t messages_sent_ = 0;
  std::size_t bytes_sent_ = 0;
};

}  // namespace hpr
