#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "cluster/transport/forwarding_communicator.h"
#include "core/timing.h"

namespace hpr {

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
    span.tell(kBytes, message.size());
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

}  // namespace hpr
