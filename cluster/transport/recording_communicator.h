#pragma once

#include <map>
#include <utility>
#include <vector>

#include "cluster/transport/forwarding_communicator.h"
#include "cluster/transport/schedule.h"

namespace hpr {

/// Notes what this rank sends, takes and merges in place, and with whom it meets, in its order: the deeds of all ranks
/// make a Schedule. It adds nothing to the messages. What goes through a subset is noted here too, by the ranks of this
/// communicator.
class RecordingCommunicator final : public ForwardingCommunicator {
 public:
  explicit RecordingCommunicator(Communicator& inner);

  /// What this rank has done since it was last asked. All messages given until now must be taken before ranks ask.
  [[nodiscard]] std::vector<Deed> take_deeds() { return std::exchange(log_->deeds, {}); }

  void send(std::span<const std::byte> message, int to) override;
  void receive(std::span<std::byte> message, int from) override;
  [[nodiscard]] std::vector<std::byte> receive(int from) override;
  void exchange(std::span<const Outgoing> out, std::span<const int> from, const Arrived& arrived) override;
  void reduce_max(std::span<std::uint64_t> values, int root) override;
  [[nodiscard]] std::unique_ptr<Communicator> subset(std::span<const int> members) override;
  [[nodiscard]] std::shared_ptr<PeerMemory> share(std::size_t bytes) override;
  void worked(std::size_t bytes) override;

 private:
  class Memory;
  using Channel = std::vector<int>;

  /// One rank's, for a communicator and its subsets.
  struct Log {
    std::vector<Deed> deeds;
    std::map<std::pair<Channel, std::pair<int, int>>, int> numbers;  ///< messages of a route so far
    std::vector<int> host;                                           ///< the ranks last met
    bool exchanging = false;                                         ///< bodies and merges belong to a message
  };

  RecordingCommunicator(std::unique_ptr<Communicator> part, RecordingCommunicator& whole, Channel channel,
                        std::vector<int> worlds);

  [[nodiscard]] int world(int rank) const { return worlds_[static_cast<std::size_t>(rank)]; }
  [[nodiscard]] Ticket next_ticket(const Channel& channel, int from, int to);
  void note_received(int from);

  Log own_;
  Log* log_;
  Channel channel_;  ///< empty for the whole; of a subset its members, -1 and how many of just these came before
  std::vector<int> worlds_;  ///< per rank here, its rank in the whole
  std::map<Channel, int> subsets_made_;
  int shares_ = 0;
};

}  // namespace hpr
