#pragma once

#include <memory>
#include <utility>

#include "cluster/transport/communicator.h"

namespace hpr {

/// Passes every call on: the base of communicators that change or watch one thing.
class ForwardingCommunicator : public Communicator {
 public:
  explicit ForwardingCommunicator(Communicator& inner) : inner_(&inner) {}

  [[nodiscard]] int rank() const override { return inner_->rank(); }
  [[nodiscard]] int size() const override { return inner_->size(); }
  [[nodiscard]] std::string_view transport() const override { return inner_->transport(); }
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
  [[nodiscard]] double seconds() const override { return inner_->seconds(); }
  [[nodiscard]] bool models_time() const override { return inner_->models_time(); }
  void worked(std::size_t bytes) override { inner_->worked(bytes); }

 protected:
  /// Of a communicator it owns.
  explicit ForwardingCommunicator(std::unique_ptr<Communicator> inner)
      : owned_(std::move(inner)), inner_(owned_.get()) {}
  [[nodiscard]] Communicator& inner() { return *inner_; }

 private:
  std::unique_ptr<Communicator> owned_;
  Communicator* inner_;
};

}  // namespace hpr
