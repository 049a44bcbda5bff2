#pragma once

#include <utility>

#include "cluster/communicator.h"

namespace hpr {

/// Passes every message on and counts what this rank sends: the cost model of a strategy, free of timing noise.
/// A reduce_max counts as the one message of its values that each rank but the root gives away. What goes through a
/// subset counts here too.
class CountingCommunicator final : public Communicator {
 public:
  explicit CountingCommunicator(Communicator& inner) : inner_(inner) {}

  [[nodiscard]] std::size_t messages_sent() const { return messages_sent_; }
  [[nodiscard]] std::size_t bytes_sent() const { return bytes_sent_; }

  [[nodiscard]] int rank() const override { return inner_.rank(); }
  [[nodiscard]] int size() const override { return inner_.size(); }
  [[nodiscard]] std::string_view transport() const override { return inner_.transport(); }
  void send(std::span<const std::byte> message, int to) override {
    count(message);
    inner_.send(message, to);
  }
  void receive(std::span<std::byte> message, int from) override { inner_.receive(message, from); }
  [[nodiscard]] std::vector<std::byte> receive(int from) override { return inner_.receive(from); }
  [[nodiscard]] std::vector<std::byte> exchange(std::span<const std::byte> out, int peer) override {
    count(out);
    return inner_.exchange(out, peer);
  }
  void reduce_max(std::span<std::uint64_t> values, int root) override {
    if (rank() != root) count(std::as_bytes(values));
    inner_.reduce_max(values, root);
  }
  [[nodiscard]] std::unique_ptr<Communicator> subset(std::span<const int> members) override {
    return std::unique_ptr<Communicator>(new CountingCommunicator(inner_.subset(members), *this));
  }

 private:
  CountingCommunicator(std::unique_ptr<Communicator> part, CountingCommunicator& whole)
      : owned_(std::move(part)), inner_(*owned_), whole_(&whole) {}

  void count(std::span<const std::byte> message) {
    ++messages_sent_;
    bytes_sent_ += message.size();
    if (whole_ != nullptr) whole_->count(message);
  }

  std::unique_ptr<Communicator> owned_;  ///< of a subset
  Communicator& inner_;
  CountingCommunicator* whole_ = nullptr;  ///< what this one is a subset of
  std::size_t messages_sent_ = 0;
  std::size_t bytes_sent_ = 0;
};

}  // namespace hpr
