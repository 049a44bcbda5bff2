#include "cluster/transport/schedule.h"

#include <algorithm>
#include <map>
#include <numeric>

#include "core/error.h"

namespace hpr {
namespace {

/// Goes through the deeds of all ranks as far as each can without what others have not given yet, again and again.
class Replay {
 public:
  explicit Replay(std::span<const std::vector<Deed>> deeds) : deeds_(deeds), ranks_(deeds.size()) {
    schedule_.ranks = static_cast<int>(deeds.size());
  }

  Schedule run() {
    for (bool moved = true; moved;) {
      moved = false;
      for (std::size_t rank = 0; rank < deeds_.size(); ++rank) {
        while (advance(rank)) moved = true;
      }
    }
    for (std::size_t rank = 0; rank < deeds_.size(); ++rank) HPR_CHECK(ranks_[rank].next == deeds_[rank].size());
    join_works();
    std::ranges::sort(schedule_.transfers);
    std::ranges::sort(schedule_.gatherings);
    auto& gatherings = schedule_.gatherings;
    gatherings.erase(std::unique(gatherings.begin(), gatherings.end()),
                     gatherings.end());  // every member has told of it
    return std::move(schedule_);
  }

 private:
  struct Progress {
    std::size_t next = 0;
    int round = 0;
    bool gave = false;  ///< what the next deed gives
  };
  struct Parcel {
    int round = 0;
    std::size_t bytes = 0;
  };

  /// Does a rank's next deed; false when there is none or it waits.
  bool advance(std::size_t rank) {
    Progress& progress = ranks_[rank];
    if (progress.next == deeds_[rank].size()) return false;
    const Deed& deed = deeds_[rank][progress.next];
    if (!progress.gave) {
      for (const auto& [ticket, bytes] : deed.given) parcels_[ticket] = {progress.round, bytes};
      progress.gave = true;
    }
    if (!std::ranges::all_of(deed.taken, [&](const Ticket& ticket) { return parcels_.contains(ticket); })) return false;
    int last = progress.round;
    for (const Ticket& ticket : deed.taken) {
      const Parcel& parcel = parcels_[ticket];
      const int round = std::max(progress.round, parcel.round);
      last = std::max(last, round);
      if (deed.kind == Deed::Kind::Gathering) continue;
      schedule_.transfers.push_back({round, ticket.from, ticket.to, parcel.bytes, deed.kind == Deed::Kind::Reduction});
    }
    if (deed.kind == Deed::Kind::Gathering) schedule_.gatherings.push_back({last, deed.ranks});
    if (deed.kind == Deed::Kind::InPlaceWork) schedule_.works.push_back({last, deed.ranks, deed.bytes});
    progress = {progress.next + 1, last + 1, false};
    schedule_.rounds = std::max(schedule_.rounds, last + 1);
    return true;
  }

  void join_works() {
    std::map<std::pair<int, std::vector<int>>, std::size_t> joined;
    for (const InPlaceWork& work : schedule_.works) joined[{work.round, work.ranks}] += work.bytes;
    schedule_.works.clear();
    for (const auto& [where, bytes] : joined) schedule_.works.push_back({where.first, where.second, bytes});
  }

  std::span<const std::vector<Deed>> deeds_;
  std::vector<Progress> ranks_;
  std::map<Ticket, Parcel> parcels_;
  Schedule schedule_;
};

// What is no message goes through channels of its own.
constexpr int kReductions = -2;
constexpr int kGatherings = -3;

std::vector<int> extended(std::vector<int> channel, std::initializer_list<int> by) {
  channel.insert(channel.end(), by);
  return channel;
}

}  // namespace

Schedule schedule_of(std::span<const std::vector<Deed>> deeds) {
  return Replay(deeds).run();
}

/// Notes the meetings.
class RecordingCommunicator::Memory final : public PeerMemory {
 public:
  Memory(std::shared_ptr<PeerMemory> inner, RecordingCommunicator& comm, Channel channel)
      : inner_(std::move(inner)), comm_(comm), channel_(std::move(channel)) {
    for (int rank = 0; rank < comm.size(); ++rank) {
      if (!inner_->of(rank).empty()) host_.push_back(comm.world(rank));
    }
  }

  [[nodiscard]] std::span<std::byte> mine() override { return inner_->mine(); }
  [[nodiscard]] std::span<std::byte> of(int rank) override { return inner_->of(rank); }
  void meet() override {
    // As if every rank sent each other one a message of no bytes.
    const int self = comm_.world(comm_.rank());
    Deed deed{Deed::Kind::Gathering, {}, {}, host_, 0};
    for (const int peer : host_) {
      if (peer == self) continue;
      deed.given.push_back({comm_.next_ticket(channel_, self, peer), 0});
      deed.taken.push_back(comm_.next_ticket(channel_, peer, self));
    }
    comm_.log_->deeds.push_back(std::move(deed));
    comm_.log_->host = host_;
    inner_->meet();
  }

 private:
  std::shared_ptr<PeerMemory> inner_;
  RecordingCommunicator& comm_;
  Channel channel_;
  std::vector<int> host_;
};

RecordingCommunicator::RecordingCommunicator(Communicator& inner)
    : ForwardingCommunicator(inner), log_(&own_), worlds_(static_cast<std::size_t>(inner.size())) {
  std::iota(worlds_.begin(), worlds_.end(), 0);
  own_.host = {inner.rank()};
}

RecordingCommunicator::RecordingCommunicator(std::unique_ptr<Communicator> part, RecordingCommunicator& whole,
                                             Channel channel, std::vector<int> worlds)
    : ForwardingCommunicator(std::move(part)),
      log_(whole.log_),
      channel_(std::move(channel)),
      worlds_(std::move(worlds)) {}

Ticket RecordingCommunicator::next_ticket(const Channel& channel, int from, int to) {
  return {channel, from, to, log_->numbers[{channel, {from, to}}]++};
}

void RecordingCommunicator::send(std::span<const std::byte> message, int to) {
  const Ticket ticket = next_ticket(channel_, world(rank()), world(to));
  log_->deeds.push_back({Deed::Kind::Messages, {{ticket, message.size()}}, {}, {}, 0});
  inner().send(message, to);
}

void RecordingCommunicator::note_received(int from) {
  if (log_->exchanging) return;
  log_->deeds.push_back({Deed::Kind::Messages, {}, {next_ticket(channel_, world(from), world(rank()))}, {}, 0});
}

void RecordingCommunicator::receive(std::span<std::byte> message, int from) {
  note_received(from);
  inner().receive(message, from);
}

std::vector<std::byte> RecordingCommunicator::receive(int from) {
  note_received(from);
  return inner().receive(from);
}

void RecordingCommunicator::exchange(std::span<const Outgoing> out, std::span<const int> from, const Arrived& arrived) {
  Deed deed;
  for (const Outgoing& outgoing : out) {
    deed.given.push_back({next_ticket(channel_, world(rank()), world(outgoing.to)), bytes_of(outgoing)});
  }
  for (const int peer : from) deed.taken.push_back(next_ticket(channel_, world(peer), world(rank())));
  log_->deeds.push_back(std::move(deed));
  log_->exchanging = true;
  inner().exchange(out, from, arrived);
  log_->exchanging = false;
}

void RecordingCommunicator::reduce_max(std::span<std::uint64_t> values, int root) {
  const Channel channel = extended(channel_, {kReductions});
  Deed deed{Deed::Kind::Reduction, {}, {}, {}, 0};
  if (rank() == root) {
    for (int peer = 0; peer < size(); ++peer) {
      if (peer != root) deed.taken.push_back(next_ticket(channel, world(peer), world(root)));
    }
  } else {
    deed.given.push_back({next_ticket(channel, world(rank()), world(root)), values.size_bytes()});
  }
  log_->deeds.push_back(std::move(deed));
  inner().reduce_max(values, root);
}

std::unique_ptr<Communicator> RecordingCommunicator::subset(std::span<const int> members) {
  std::vector<int> worlds;
  for (const int member : members) worlds.push_back(world(member));
  Channel channel = channel_;
  channel.insert(channel.end(), worlds.begin(), worlds.end());
  const int nth = subsets_made_[channel]++;
  return std::unique_ptr<Communicator>(
      new RecordingCommunicator(inner().subset(members), *this, extended(std::move(channel), {-1, nth}), worlds));
}

std::shared_ptr<PeerMemory> RecordingCommunicator::share(std::size_t bytes) {
  return std::make_shared<Memory>(inner().share(bytes), *this, extended(channel_, {kGatherings, shares_++}));
}

void RecordingCommunicator::worked(std::size_t bytes) {
  inner().worked(bytes);
  if (log_->exchanging || bytes == 0) return;
  auto& deeds = log_->deeds;
  if (deeds.empty() || deeds.back().kind != Deed::Kind::InPlaceWork) {
    deeds.push_back({Deed::Kind::InPlaceWork, {}, {}, log_->host, 0});
  }
  deeds.back().bytes += bytes;
}

}  // namespace hpr
