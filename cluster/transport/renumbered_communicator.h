#pragma once

#include <algorithm>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "cluster/transport/forwarding_communicator.h"

namespace hpr {

/// The same ranks under other numbers, such as their places in an order of visibility: what works on neighbours in
/// number then works on neighbours in that order.
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
