#include "cluster/transport/schedule.h"

#include <algorithm>
#include <map>
#include <numeric>

#include "core/error.h"

namespace hpr {
namespace {

/// Replays the events of all ranks, each as far as it can without messages that others have not sent yet, until done.
class Replay {
 public:
  explicit Replay(std::span<const std::vector<TraceEvent>> events) : events_(events), ranks_(events.size()) {
    schedule_.ranks = static_cast<int>(events.size());
  }

  Schedule run() {
    for (bool moved = true; moved;) {
      moved = false;
      for (std::size_t rank = 0; rank < events_.size(); ++rank) {
        while (advance(rank)) moved = true;
      }
    }
    for (std::size_t rank = 0; rank < events_.size(); ++rank) HPR_CHECK(ranks_[rank].next == events_[rank].size());
    join_works();
    std::ranges::sort(schedule_.transfers);
    std::ranges::sort(schedule_.barriers);
    auto& barriers = schedule_.barriers;
    barriers.erase(std::unique(barriers.begin(), barriers.end()),
                   barriers.end());  // every member recorded it
    return std::move(schedule_);
  }

 private:
  struct Progress {
    std::size_t next = 0;
    int round = 0;
    bool sent = false;  ///< the messages of the next event
  };
  struct SentMessage {
    int round = 0;
    std::size_t bytes = 0;
  };

  /// Replays a rank's next event; false when there is none or it waits.
  bool advance(std::size_t rank) {
    Progress& progress = ranks_[rank];
    if (progress.next == events_[rank].size()) return false;
    const TraceEvent& event = events_[rank][progress.next];
    if (!progress.sent) {
      for (const auto& [id, bytes] : event.sent) messages_[id] = {progress.round, bytes};
      progress.sent = true;
    }
    if (!std::ranges::all_of(event.received, [&](const MessageId& id) { return messages_.contains(id); })) return false;
    int last = progress.round;
    for (const MessageId& id : event.received) {
      const SentMessage& message = messages_[id];
      const int round = std::max(progress.round, message.round);
      last = std::max(last, round);
      if (event.kind == TraceEvent::Kind::Barrier) continue;
      schedule_.transfers.push_back({round, id.from, id.to, message.bytes, event.kind == TraceEvent::Kind::Reduction});
    }
    if (event.kind == TraceEvent::Kind::Barrier) schedule_.barriers.push_back({last, event.ranks});
    if (event.kind == TraceEvent::Kind::InPlaceWork) schedule_.works.push_back({last, event.ranks, event.bytes});
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

  std::span<const std::vector<TraceEvent>> events_;
  std::vector<Progress> ranks_;
  std::map<MessageId, SentMessage> messages_;
  Schedule schedule_;
};

// What is no message goes through channels of its own.
constexpr int kReductions = -2;
constexpr int kBarriers = -3;

std::vector<int> extended(std::vector<int> channel, std::initializer_list<int> by) {
  channel.insert(channel.end(), by);
  return channel;
}

}  // namespace

Schedule schedule_of(std::span<const std::vector<TraceEvent>> events) {
  return Replay(events).run();
}

/// Records the barriers of ranks that share memory.
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
    TraceEvent event{TraceEvent::Kind::Barrier, {}, {}, host_, 0};
    for (const int peer : host_) {
      if (peer == self) continue;
      event.sent.push_back({comm_.next_id(channel_, self, peer), 0});
      event.received.push_back(comm_.next_id(channel_, peer, self));
    }
    comm_.log_->events.push_back(std::move(event));
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

MessageId RecordingCommunicator::next_id(const Channel& channel, int from, int to) {
  return {channel, from, to, log_->numbers[{channel, {from, to}}]++};
}

void RecordingCommunicator::send(std::span<const std::byte> message, int to) {
  const MessageId id = next_id(channel_, world(rank()), world(to));
  log_->events.push_back({TraceEvent::Kind::Messages, {{id, message.size()}}, {}, {}, 0});
  inner().send(message, to);
}

void RecordingCommunicator::note_received(int from) {
  if (log_->exchanging) return;
  log_->events.push_back({TraceEvent::Kind::Messages, {}, {next_id(channel_, world(from), world(rank()))}, {}, 0});
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
  TraceEvent event;
  for (const Outgoing& outgoing : out) {
    event.sent.push_back({next_id(channel_, world(rank()), world(outgoing.to)), bytes_of(outgoing)});
  }
  for (const int peer : from) event.received.push_back(next_id(channel_, world(peer), world(rank())));
  log_->events.push_back(std::move(event));
  log_->exchanging = true;
  inner().exchange(out, from, arrived);
  log_->exchanging = false;
}

void RecordingCommunicator::reduce_max(std::span<std::uint64_t> values, int root) {
  const Channel channel = extended(channel_, {kReductions});
  TraceEvent event{TraceEvent::Kind::Reduction, {}, {}, {}, 0};
  if (rank() == root) {
    for (int peer = 0; peer < size(); ++peer) {
      if (peer != root) event.received.push_back(next_id(channel, world(peer), world(root)));
    }
  } else {
    event.sent.push_back({next_id(channel, world(rank()), world(root)), values.size_bytes()});
  }
  log_->events.push_back(std::move(event));
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
  return std::make_shared<Memory>(inner().share(bytes), *this, extended(channel_, {kBarriers, shared_blocks_++}));
}

void RecordingCommunicator::worked(std::size_t bytes) {
  inner().worked(bytes);
  if (log_->exchanging || bytes == 0) return;
  auto& events = log_->events;
  if (events.empty() || events.back().kind != TraceEvent::Kind::InPlaceWork) {
    events.push_back({TraceEvent::Kind::InPlaceWork, {}, {}, log_->host, 0});
  }
  events.back().bytes += bytes;
}

}  // namespace hpr
