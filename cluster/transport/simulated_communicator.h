#pragma once

#include <memory>
#include <vector>

#include "cluster/transport/communicator_wrappers.h"

namespace hpr {

/// A modelled cluster. Times are seconds, rates bytes per second.
struct SimulatedCluster {
  int hosts = 1;
  int ranks = 2;  ///< spread over the hosts in order, as evenly as their number allows
  int cores = 0;  ///< per host, which its ranks share; 0: one for each rank
  double latency = 2e-6;
  double bandwidth = 12.5e9;  ///< of a rank's part of its host's link, in each direction
  double overhead = 0.5e-6;   ///< of a core, per message sent or received
  double local_latency = 0.5e-6;
  double local_bandwidth = 8e9;  ///< between ranks of one host
  double merge = 12e9;           ///< of one core

  [[nodiscard]] int ranks_per_host() const { return (ranks + hosts - 1) / hosts; }
  /// How much longer a core takes that several ranks share.
  [[nodiscard]] double slowdown() const {
    return cores > 0 && ranks_per_host() > cores ? static_cast<double>(ranks_per_host()) / cores : 1.0;
  }
};

/// Carries messages by another communicator and models the time they would take on a cluster: after LogGP (Alexandrov,
/// Ionescu, Schauser and Scheiman, 1995) every message costs both ends an overhead, leaves when the sender's link is
/// free, and is there when it has passed the latency and the receiver's link. Pixels merged or copied (worked()) take
/// their time too. Messages of an exchange are handed out in the order they would have come, so that the modelled time
/// depends on nothing but what was sent: the same on every run.
///
/// Each rank has its own; ranks of one host are those that share memory in the communicator underneath.
class SimulatedCommunicator final : public ForwardingCommunicator {
 public:
  SimulatedCommunicator(Communicator& inner, const SimulatedCluster& cluster);

  [[nodiscard]] std::string_view transport() const override { return "simulated"; }
  [[nodiscard]] double seconds() const override { return clock_->now; }
  [[nodiscard]] bool models_time() const override { return true; }
  void worked(std::size_t bytes) override;

  void send(std::span<const std::byte> message, int to) override;
  void receive(std::span<std::byte> message, int from) override;
  [[nodiscard]] std::vector<std::byte> receive(int from) override;
  void exchange(std::span<const Outgoing> out, std::span<const int> from, const Arrived& arrived) override;
  void reduce_max(std::span<std::uint64_t> values, int root) override;
  [[nodiscard]] std::unique_ptr<Communicator> subset(std::span<const int> members) override;
  [[nodiscard]] std::shared_ptr<PeerMemory> share(std::size_t bytes) override;

 private:
  /// One rank's time, and when its links are free again.
  struct Clock {
    double now = 0.0;
    double out_free = 0.0;
    double in_free = 0.0;
  };
  /// What is sent before a message.
  struct Stamp {
    double sent = 0.0;  ///< when its last byte left
    double bytes = 0.0;
  };
  class Memory;

  SimulatedCommunicator(std::unique_ptr<Communicator> inner, const SimulatedCommunicator& whole,
                        std::span<const int> members);

  [[nodiscard]] bool near(int rank) const;
  /// Lets a message leave.
  [[nodiscard]] Stamp stamp(std::size_t bytes, int to);
  /// When a message is here, if links take messages in the order they are asked in.
  [[nodiscard]] double arrival(const Stamp& stamp, int from) const;
  void take(const Stamp& stamp, int from);

  SimulatedCluster cluster_;
  std::vector<int> hosts_;  ///< per rank
  std::shared_ptr<Clock> clock_;
  bool in_exchange_ = false;  ///< segments of its messages have no stamps of their own
};

}  // namespace hpr
