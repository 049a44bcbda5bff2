#include "cluster/transport/communicator_wrappers.h"

#include "core/error.h"

namespace hpr {
namespace {

class RenumberedMemory final : public PeerMemory {
 public:
  RenumberedMemory(std::shared_ptr<PeerMemory> inner, std::vector<int> ranks)
      : inner_(std::move(inner)), ranks_(std::move(ranks)) {}

  [[nodiscard]] std::span<std::byte> mine() override { return inner_->mine(); }
  [[nodiscard]] std::span<std::byte> of(int rank) override {
    return inner_->of(ranks_.at(static_cast<std::size_t>(rank)));
  }
  void meet() override { inner_->meet(); }

 private:
  std::shared_ptr<PeerMemory> inner_;
  std::vector<int> ranks_;
};

}  // namespace

RenumberedCommunicator::RenumberedCommunicator(Communicator& inner, std::span<const int> ranks)
    : ForwardingCommunicator(inner), ranks_(ranks.begin(), ranks.end()) {
  check();
}

RenumberedCommunicator::RenumberedCommunicator(std::unique_ptr<Communicator> inner, std::span<const int> ranks)
    : ForwardingCommunicator(std::move(inner)), ranks_(ranks.begin(), ranks.end()) {
  check();
}

void RenumberedCommunicator::check() const {
  std::vector<int> sorted = ranks_;
  std::ranges::sort(sorted);
  bool each_once = static_cast<int>(sorted.size()) == size();
  for (std::size_t i = 0; each_once && i < sorted.size(); ++i) each_once = sorted[i] == static_cast<int>(i);
  if (!each_once) throw Error(ExitCode::Internal, "an order of ranks does not name every rank once");
}

void RenumberedCommunicator::exchange(std::span<const Outgoing> out, std::span<const int> from,
                                      const Arrived& arrived) {
  std::vector<Outgoing> to_ranks(out.begin(), out.end());
  for (Outgoing& outgoing : to_ranks) outgoing.to = rank_of(outgoing.to);
  std::vector<int> from_ranks;
  for (const int number : from) from_ranks.push_back(rank_of(number));
  inner().exchange(to_ranks, from_ranks,
                   [&](int rank, std::span<const std::byte> message) { arrived(number_of(rank), message); });
}

std::unique_ptr<Communicator> RenumberedCommunicator::subset(std::span<const int> members) {
  std::vector<int> ranks;
  ranks.reserve(members.size());
  for (const int number : members) ranks.push_back(rank_of(number));
  std::vector<int> ascending = ranks;
  std::ranges::sort(ascending);
  std::vector<int> numbers;
  numbers.reserve(ranks.size());
  for (const int rank : ranks) {
    numbers.push_back(static_cast<int>(std::ranges::find(ascending, rank) - ascending.begin()));
  }
  return std::unique_ptr<Communicator>(new RenumberedCommunicator(inner().subset(ascending), numbers));
}

std::shared_ptr<PeerMemory> RenumberedCommunicator::share(std::size_t bytes) {
  return std::make_shared<RenumberedMemory>(inner().share(bytes), ranks_);
}

}  // namespace hpr
