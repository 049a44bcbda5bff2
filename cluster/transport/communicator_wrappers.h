#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "cluster/transport/communicator.h"
#include "core/timing.h"

namespace hpr {

/// Forwards every call: the base of communicators that change or observe one thing.
class ForwardingCommunicator : public Communicator {
 public:
  explicit ForwardingCommunicator(Communicator& inner) : inner_(&inner) {}

  [[nodiscard]] int rank() const override { return inner_->rank(); }
  [[nodiscard]] int size() const override { return inner_->size(); }
  [[nodiscard]] std::string_view transport() const override { return inner_->transport(); }
  void begin_frame(std::uint64_t frame) override { inner_->begin_frame(frame); }
  void send(std::span<const std::byte> message, int to) override { inner_->send(message, to); }
  void receive(std::span<std::byte> message, int from) override { inner_->receive(message, from); }
  [[nodiscard]] std::vector<std::byte> receive(int from) override { return inner_->receive(from); }
  void exchange(std::span<const Outgoing> out, std::span<const int> from, const Arrived& arrived) override {
    inner_->exchange(out, from, arrived);
  }
  void reduce_max(std::span<std::uint64_t> values, int root) override { inner_->reduce_max(values, root); }
  [[nodiscard]] std::unique_ptr<Communicator> subset(std::span<const int> members) override {
    return inner_->subset(members);
  }
  [[nodiscard]] std::shared_ptr<PeerMemory> share(std::size_t bytes) override { return inner_->share(bytes); }
  [[nodiscard]] std::chrono::nanoseconds hang_timeout() const override { return inner_->hang_timeout(); }
  [[nodiscard]] double seconds() const override { return inner_->seconds(); }
  [[nodiscard]] bool models_time() const override { return inner_->models_time(); }
  void worked(std::size_t bytes) override { inner_->worked(bytes); }

 protected:
  /// Forwards to a communicator that this object owns.
  explicit ForwardingCommunicator(std::unique_ptr<Communicator> inner)
      : owned_(std::move(inner)), inner_(owned_.get()) {}
  [[nodiscard]] Communicator& inner() { return *inner_; }

 private:
  std::unique_ptr<Communicator> owned_;
  Communicator* inner_;
};

/// Counts what this rank sends: the cost model of a strategy, free of timing noise. A message counts as one with all
/// its segments; what ranks read of each other's memory does not count. A reduce_max counts as the one
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

/// Records how long this rank's calls take, waits included, and the bytes they send or receive.
class TracingCommunicator final : public ForwardingCommunicator {
 public:
  explicit TracingCommunicator(Communicator& inner) : ForwardingCommunicator(inner) {}

  void send(std::span<const std::byte> message, int to) override {
    const trace::Span span("send", kBytes, message.size());
    inner().send(message, to);
  }
  void receive(std::span<std::byte> message, int from) override {
    const trace::Span span("receive", kBytes, message.size());
    inner().receive(message, from);
  }
  [[nodiscard]] std::vector<std::byte> receive(int from) override {
    trace::Span span("receive");
    std::vector<std::byte> message = inner().receive(from);
    span.set_detail(kBytes, message.size());
    return message;
  }
  void exchange(std::span<const Outgoing> out, std::span<const int> from, const Arrived& arrived) override {
    std::size_t bytes = 0;
    for (const Outgoing& outgoing : out) bytes += bytes_of(outgoing);
    const trace::Span span("exchange", kBytes, bytes);
    inner().exchange(out, from, arrived);
  }
  void reduce_max(std::span<std::uint64_t> values, int root) override {
    const trace::Span span("reduce", kBytes, values.size_bytes());
    inner().reduce_max(values, root);
  }
  [[nodiscard]] std::unique_ptr<Communicator> subset(std::span<const int> members) override {
    return std::unique_ptr<Communicator>(new TracingCommunicator(inner().subset(members)));
  }

 private:
  explicit TracingCommunicator(std::unique_ptr<Communicator> part) : ForwardingCommunicator(std::move(part)) {}

  static constexpr const char* kBytes = "bytes";
};

/// Renumbers the ranks of a communicator, for example by their order of visibility: what works on neighbours in number
/// then works on neighbours in that order.
class RenumberedCommunicator final : public ForwardingCommunicator {
 public:
  /// ranks[n]: which rank of `inner` is rank n here, the same list on all ranks. Throws Error (Internal) when it does
  /// not hold every rank of `inner` once.
  RenumberedCommunicator(Communicator& inner, std::span<const int> ranks);

  [[nodiscard]] int rank() const override { return number_of(ForwardingCommunicator::rank()); }
  void send(std::span<const std::byte> message, int to) override { inner().send(message, rank_of(to)); }
  void receive(std::span<std::byte> message, int from) override { inner().receive(message, rank_of(from)); }
  [[nodiscard]] std::vector<std::byte> receive(int from) override { return inner().receive(rank_of(from)); }
  void exchange(std::span<const Outgoing> out, std::span<const int> from, const Arrived& arrived) override;
  void reduce_max(std::span<std::uint64_t> values, int root) override { inner().reduce_max(values, rank_of(root)); }
  [[nodiscard]] std::unique_ptr<Communicator> subset(std::span<const int> members) override;
  [[nodiscard]] std::shared_ptr<PeerMemory> share(std::size_t bytes) override;

 private:
  RenumberedCommunicator(std::unique_ptr<Communicator> inner, std::span<const int> ranks);
  void check() const;

  [[nodiscard]] int rank_of(int number) const { return ranks_.at(static_cast<std::size_t>(number)); }
  [[nodiscard]] int number_of(int rank) const {
    return static_cast<int>(std::ranges::find(ranks_, rank) - ranks_.begin());
  }

  std::vector<int> ranks_;
};

}  // namespace hpr
