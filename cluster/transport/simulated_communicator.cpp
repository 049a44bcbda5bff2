#include "cluster/transport/simulated_communicator.h"

#include <algorithm>
#include <cstring>
#include <tuple>

#include "cluster/transport/collectives.h"
#include "core/error.h"

namespace hpr {
namespace {

std::span<const std::byte> bytes_of_value(const auto& value) {
  return std::as_bytes(std::span(&value, 1));
}

}  // namespace

/// The clocks of a host's ranks stand beside its memory, so that a meeting brings them together.
class SimulatedCommunicator::Memory final : public PeerMemory {
 public:
  Memory(std::shared_ptr<PeerMemory> inner, std::size_t bytes, std::shared_ptr<Clock> clock, int ranks,
         const SimulatedCluster& cluster)
      : inner_(std::move(inner)), bytes_(bytes), clock_(std::move(clock)), ranks_(ranks), cluster_(cluster) {}

  [[nodiscard]] std::span<std::byte> mine() override { return inner_->mine().last(bytes_); }
  [[nodiscard]] std::span<std::byte> of(int rank) override {
    const auto all = inner_->of(rank);
    return all.empty() ? all : all.last(bytes_);
  }
  void meet() override {
    std::memcpy(inner_->mine().data(), &clock_->now, sizeof clock_->now);
    inner_->meet();
    double latest = clock_->now;
    int here = 0;
    for (int rank = 0; rank < ranks_; ++rank) {
      const auto part = inner_->of(rank);
      if (part.empty()) continue;
      double now = 0.0;
      std::memcpy(&now, part.data(), sizeof now);
      latest = std::max(latest, now);
      ++here;
    }
    inner_->meet();  // before anyone's clock changes
    if (here > 1) latest += 2.0 * cluster_.local_latency;
    clock_->now = latest;
  }

  static constexpr std::size_t kClockBytes = 64;

 private:
  std::shared_ptr<PeerMemory> inner_;
  std::size_t bytes_;
  std::shared_ptr<Clock> clock_;
  int ranks_;
  SimulatedCluster cluster_;
};

SimulatedCommunicator::SimulatedCommunicator(Communicator& inner, const SimulatedCluster& cluster)
    : ForwardingCommunicator(inner), cluster_(cluster), clock_(std::make_shared<Clock>()) {
  HPR_CHECK(inner.size() == cluster.ranks);
  for (int rank = 0; rank < inner.size(); ++rank) hosts_.push_back(rank / cluster.ranks_per_host());
}

SimulatedCommunicator::SimulatedCommunicator(std::unique_ptr<Communicator> inner, const SimulatedCommunicator& whole,
                                             std::span<const int> members)
    : ForwardingCommunicator(std::move(inner)), cluster_(whole.cluster_), clock_(whole.clock_) {
  for (const int member : members) hosts_.push_back(whole.hosts_[static_cast<std::size_t>(member)]);
}

bool SimulatedCommunicator::near(int rank) const {
  return hosts_.at(static_cast<std::size_t>(rank)) == hosts_.at(static_cast<std::size_t>(this->rank()));
}

void SimulatedCommunicator::worked(std::size_t bytes) {
  clock_->now += static_cast<double>(bytes) / cluster_.merge * cluster_.slowdown();
}

SimulatedCommunicator::Stamp SimulatedCommunicator::stamp(std::size_t bytes, int to) {
  clock_->now += cluster_.overhead * cluster_.slowdown();
  const double rate = near(to) ? cluster_.local_bandwidth / cluster_.slowdown() : cluster_.bandwidth;
  clock_->out_free = std::max(clock_->out_free, clock_->now) + static_cast<double>(bytes) / rate;
  return {clock_->out_free, static_cast<double>(bytes)};
}

double SimulatedCommunicator::arrival(const Stamp& stamp, int from) const {
  return stamp.sent + (near(from) ? cluster_.local_latency : cluster_.latency);
}

void SimulatedCommunicator::take(const Stamp& stamp, int from) {
  const double rate = near(from) ? cluster_.local_bandwidth / cluster_.slowdown() : cluster_.bandwidth;
  // The last byte comes when it has travelled, and not before this link has taken in everything before it.
  clock_->in_free = std::max(arrival(stamp, from), clock_->in_free + stamp.bytes / rate);
  clock_->now = std::max(clock_->now, clock_->in_free) + cluster_.overhead * cluster_.slowdown();
}

void SimulatedCommunicator::send(std::span<const std::byte> message, int to) {
  const Stamp own = stamp(message.size(), to);
  inner().send(bytes_of_value(own), to);
  inner().send(message, to);
}

void SimulatedCommunicator::receive(std::span<std::byte> message, int from) {
  if (!in_exchange_) {
    Stamp theirs;
    inner().receive(std::as_writable_bytes(std::span(&theirs, 1)), from);
    take(theirs, from);
  }
  inner().receive(message, from);
}

std::vector<std::byte> SimulatedCommunicator::receive(int from) {
  if (!in_exchange_) {
    Stamp theirs;
    inner().receive(std::as_writable_bytes(std::span(&theirs, 1)), from);
    take(theirs, from);
  }
  return inner().receive(from);
}

void SimulatedCommunicator::exchange(std::span<const Outgoing> out, std::span<const int> from, const Arrived& arrived) {
  std::vector<std::vector<std::byte>> messages;
  std::vector<Outgoing> stamped;
  for (const Outgoing& outgoing : out) {
    const Stamp own = stamp(bytes_of(outgoing), outgoing.to);
    const auto head = bytes_of_value(own);
    auto& message = messages.emplace_back(head.begin(), head.end());
    message.insert(message.end(), outgoing.message.begin(), outgoing.message.end());
  }
  for (std::size_t i = 0; i < out.size(); ++i) stamped.push_back({out[i].to, messages[i], out[i].segments});

  struct Waiting {
    Stamp stamp;
    int from = 0;
    std::vector<std::byte> message;
  };
  std::vector<Waiting> waiting;
  inner().exchange(stamped, from, [&](int peer, std::span<const std::byte> message) {
    Waiting& one = waiting.emplace_back();
    HPR_CHECK(message.size() >= sizeof(Stamp));
    std::memcpy(&one.stamp, message.data(), sizeof(Stamp));
    one.from = peer;
    one.message.assign(message.begin() + sizeof(Stamp), message.end());
  });
  std::ranges::sort(waiting, {},
                    [&](const Waiting& one) { return std::tuple(arrival(one.stamp, one.from), one.from); });
  in_exchange_ = true;
  for (const Waiting& one : waiting) {
    take(one.stamp, one.from);
    arrived(one.from, one.message);
  }
  in_exchange_ = false;
  // What was sent may be reused when it has left.
  if (!out.empty()) clock_->now = std::max(clock_->now, clock_->out_free);
}

void SimulatedCommunicator::reduce_max(std::span<std::uint64_t> values, int root) {
  inner().reduce_max(values, root);
  // A binomial tree: in every round a message of all values, merged.
  const std::vector<double> clocks = all_gather_value(inner(), clock_->now);
  const auto bytes = static_cast<double>(values.size_bytes());
  const bool spans_hosts = std::ranges::adjacent_find(hosts_, std::ranges::not_equal_to{}) != hosts_.end();
  const double round = (spans_hosts ? cluster_.latency + bytes / cluster_.bandwidth
                                    : cluster_.local_latency + bytes / cluster_.local_bandwidth * cluster_.slowdown()) +
                       (2.0 * cluster_.overhead + bytes / cluster_.merge) * cluster_.slowdown();
  double rounds = 0.0;
  for (int reached = 1; reached < size(); reached *= 2) rounds += 1.0;
  clock_->now = rank() == root ? std::ranges::max(clocks) + rounds * round : clock_->now + round;
}

std::unique_ptr<Communicator> SimulatedCommunicator::subset(std::span<const int> members) {
  return std::unique_ptr<Communicator>(new SimulatedCommunicator(inner().subset(members), *this, members));
}

std::shared_ptr<PeerMemory> SimulatedCommunicator::share(std::size_t bytes) {
  return std::make_shared<Memory>(inner().share(Memory::kClockBytes + bytes), bytes, clock_, size(), cluster_);
}

}  // namespace hpr
