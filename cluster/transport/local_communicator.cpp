#include "cluster/transport/local_communicator.h"

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <numeric>
#include <random>
#include <system_error>
#include <thread>

#include "core/error.h"
#include "core/timing.h"

namespace hpr {
namespace {

struct Message {
  std::vector<std::byte> bytes;
  std::uint64_t frame = 0;  ///< in which its sender was
};

/// Which communicator: empty is the world; below it each subset() adds its members, a -1 and how many of just these
/// members came before. Every member knows these alike without asking the others, and no two are equal.
using Channel = std::vector<int>;

/// Who sends to whom, in which communicator.
struct Route {
  Channel channel;
  int from;
  int to;

  auto operator<=>(const Route&) const = default;  // NOLINT(modernize-use-nullptr): clang-tidy 14 sees a 0 in it
};

/// Where the ranks of one host wait for each other.
struct Meeting {
  int here = 0;
  std::uint64_t round = 0;
  int first = 0;            ///< the rank that came first
  std::uint64_t frame = 0;  ///< in which it was
};

/// What the ranks of a communicator share.
struct SharedBlock {
  SharedBlock(std::size_t size, std::size_t ranks) : bytes(size), meetings(ranks) {}

  std::vector<std::byte> bytes;
  std::vector<Meeting> meetings;  ///< of the host a rank is the first one of
};

/// All messages on their way between the ranks of this process.
class PostOffice {
 public:
  explicit PostOffice(const LocalRanks& ranks) : ranks_(ranks), hang_timeout_(std::min(ranks.hang_timeout, kMaxWait)) {}

  [[nodiscard]] const LocalRanks& ranks() const { return ranks_; }
  [[nodiscard]] std::chrono::nanoseconds hang_timeout() const { return hang_timeout_; }

  void put(const Route& route, Message message) {
    const std::lock_guard lock(mutex_);
    if (route.from == ranks_.overtaking) {
      overtake(route, std::move(message));
    } else {
      boxes_[route].push_back(std::move(message));
    }
    arrived_.notify_all();
  }

  Message take(const Route& route) { return take_any({&route, 1}).second; }

  /// The next message of any of `routes` that has one, and which: the first of them, or one by `draw` where the order
  /// is to be disturbed.
  std::pair<std::size_t, Message> take_any(std::span<const Route> routes, std::uint64_t draw = 0) {
    std::unique_lock lock(mutex_);
    std::size_t chosen = 0;
    const auto found = [&] {
      for (std::size_t i = 0; i < routes.size(); ++i) {
        chosen = (i + draw) % routes.size();
        const auto box = boxes_.find(routes[chosen]);
        if (box != boxes_.end() && !box->second.empty()) return true;
      }
      return false;
    };
    bool message = false;
    const bool in_time = arrived_.wait_for(lock, hang_timeout_, [&] { return (message = found()) || closed_; });
    if (!message) {
      const Route& route = routes.front();
      if (in_time) throw Error(ExitCode::Lost, fmt::format("rank {}: a peer failed", route.to));
      throw Error(ExitCode::Hang,
                  fmt::format("rank {}: no message from rank {} within the time limit", route.to, route.from),
                  "a rank stands still; raise --hang-timeout if it only needs longer");
    }
    auto& box = boxes_[routes[chosen]];
    std::pair<std::size_t, Message> received{chosen, std::move(box.front())};
    box.pop_front();
    return received;
  }

  /// The memory that the ranks of `channel` share by their `nth` call: whoever asks first makes it.
  std::shared_ptr<SharedBlock> memory(const Channel& channel, int nth, std::size_t bytes, int users) {
    const std::lock_guard lock(mutex_);
    Shared& shared = memories_[{channel, nth}];
    if (!shared.memory) shared.memory = std::make_shared<SharedBlock>(bytes, static_cast<std::size_t>(users));
    HPR_CHECK(shared.memory->bytes.size() == bytes);
    auto memory = shared.memory;
    if (++shared.users == users) memories_.erase({channel, nth});
    return memory;
  }

  /// Returns when `users` callers have come to a meeting that has room for them.
  void meet(Meeting& meeting, int users, int rank, std::uint64_t frame) {
    std::unique_lock lock(mutex_);
    const std::uint64_t round = meeting.round;
    if (meeting.here == 0) {
      meeting.first = rank;
      meeting.frame = frame;
    }
    check_frame(rank, frame, meeting.first, meeting.frame);
    if (++meeting.here == users) {
      meeting.here = 0;
      ++meeting.round;
      arrived_.notify_all();
      return;
    }
    if (arrived_.wait_for(lock, hang_timeout_, [&] { return meeting.round != round || closed_; })) {
      if (meeting.round != round) return;
      throw Error(ExitCode::Lost, fmt::format("rank {}: a peer failed", rank));
    }
    throw Error(ExitCode::Hang, fmt::format("rank {}: not all ranks of this host came within the time limit", rank),
                "a rank stands still; raise --hang-timeout if it only needs longer");
  }

  void close() {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    arrived_.notify_all();
  }

 private:
  struct Shared {
    std::shared_ptr<SharedBlock> memory;
    int users = 0;  ///< ranks that have it
  };

  /// Lets a route's first message of a frame overtake the last one of the frame before.
  void overtake(const Route& route, Message message) {
    auto& box = boxes_[route];
    const auto held = held_.find(route);
    if (held == held_.end()) {
      held_.emplace(route, std::move(message));
    } else if (held->second.frame == message.frame) {
      box.push_back(std::exchange(held->second, std::move(message)));
    } else {
      box.push_back(std::move(message));
      box.push_back(std::move(held->second));
      held_.erase(held);
    }
  }

  LocalRanks ranks_;
  std::chrono::nanoseconds hang_timeout_;
  std::mutex mutex_;
  std::condition_variable arrived_;
  std::map<Route, std::deque<Message>> boxes_;
  std::map<Route, Message> held_;  ///< to be overtaken
  std::map<std::pair<Channel, int>, Shared> memories_;
  bool closed_ = false;
};

/// Equal parts of one block, one per rank, of which the ranks of other hosts are out of sight.
class LocalPeerMemory final : public PeerMemory {
 public:
  /// `frame`: the one that the rank is in.
  LocalPeerMemory(PostOffice& office, std::shared_ptr<SharedBlock> memory, std::size_t bytes, int rank,
                  std::vector<int> hosts, std::shared_ptr<const std::uint64_t> frame)
      : office_(office),
        memory_(std::move(memory)),
        bytes_(bytes),
        rank_(rank),
        hosts_(std::move(hosts)),
        frame_(std::move(frame)) {}

  [[nodiscard]] std::span<std::byte> mine() override { return of(rank_); }
  [[nodiscard]] std::span<std::byte> of(int rank) override {
    const auto index = static_cast<std::size_t>(rank);
    if (hosts_.at(index) != hosts_[static_cast<std::size_t>(rank_)]) return {};
    return std::span(memory_->bytes).subspan(index * stride(bytes_), bytes_);
  }

  void meet() override {
    const int host = hosts_[static_cast<std::size_t>(rank_)];
    const auto first = std::ranges::find(hosts_, host) - hosts_.begin();
    office_.meet(memory_->meetings[static_cast<std::size_t>(first)], static_cast<int>(std::ranges::count(hosts_, host)),
                 rank_, *frame_);
  }

  static std::size_t stride(std::size_t bytes) { return (bytes + 63) / 64 * 64; }

 private:
  PostOffice& office_;
  std::shared_ptr<SharedBlock> memory_;
  std::size_t bytes_;
  int rank_;
  std::vector<int> hosts_;  ///< per rank
  std::shared_ptr<const std::uint64_t> frame_;
};

class LocalCommunicator final : public Communicator {
 public:
  /// `worlds`: per rank its number in the world, which decides its host.
  LocalCommunicator(PostOffice& office, Channel channel, std::vector<int> worlds, int rank,
                    std::shared_ptr<std::uint64_t> frame)
      : office_(office),
        frame_(std::move(frame)),
        channel_(std::move(channel)),
        worlds_(std::move(worlds)),
        random_(office.ranks().disorder + static_cast<std::uint64_t>(rank)),
        rank_(rank),
        size_(static_cast<int>(worlds_.size())) {
    // What a reduction sends must not meet a message that was sent before it and is received after it.
    reductions_ = channel_;
    reductions_.push_back(-2);
  }

  [[nodiscard]] int rank() const override { return rank_; }
  [[nodiscard]] int size() const override { return size_; }
  [[nodiscard]] std::string_view transport() const override { return "threads"; }
  [[nodiscard]] std::chrono::nanoseconds hang_timeout() const override { return office_.hang_timeout(); }
  void begin_frame(std::uint64_t frame) override { *frame_ = frame; }

  void send(std::span<const std::byte> message, int to) override { put(channel_, message, to); }
  void receive(std::span<std::byte> message, int from) override { take(channel_, message, from); }
  [[nodiscard]] std::vector<std::byte> receive(int from) override {
    HPR_CHECK(from >= 0 && from < size());
    Message message = office_.take({channel_, from, rank_});
    check_frame(rank_, *frame_, from, message.frame);
    return std::move(message.bytes);
  }
  void exchange(std::span<const Outgoing> out, std::span<const int> from, const Arrived& arrived) override {
    for (const Outgoing& outgoing : out) {
      disturb();
      send(outgoing.message, outgoing.to);
      for (const auto segment : outgoing.segments) send(segment, outgoing.to);
    }
    std::vector<Route> routes;
    for (const int rank : from) {
      HPR_CHECK(rank >= 0 && rank < size());
      routes.push_back({channel_, rank, rank_});
    }
    while (!routes.empty()) {
      disturb();
      const auto [index, message] = office_.take_any(routes, office_.ranks().disorder == 0 ? 0 : random_());
      const int sender = routes[index].from;
      routes.erase(routes.begin() + static_cast<std::ptrdiff_t>(index));
      check_frame(rank_, *frame_, sender, message.frame);
      arrived(sender, message.bytes);
    }
  }
  void reduce_max(std::span<std::uint64_t> values, int root) override {
    if (rank_ != root) {
      put(reductions_, std::as_bytes(values), root);
      return;
    }
    std::vector<std::uint64_t> other(values.size());
    for (int from = 0; from < size(); ++from) {
      if (from == root) continue;
      take(reductions_, std::as_writable_bytes(std::span(other)), from);
      std::ranges::transform(values, other, values.begin(),
                             [](std::uint64_t a, std::uint64_t b) { return std::max(a, b); });
    }
  }
  [[nodiscard]] std::unique_ptr<Communicator> subset(std::span<const int> members) override {
    const auto mine = std::ranges::find(members, rank_);
    HPR_CHECK(mine != members.end() && members.front() >= 0 && members.back() < size());
    HPR_CHECK(std::ranges::adjacent_find(members, std::greater_equal{}) == members.end());  // ascending
    Channel channel = channel_;
    channel.insert(channel.end(), members.begin(), members.end());
    const int nth = subsets_made_[channel]++;
    channel.insert(channel.end(), {-1, nth});
    std::vector<int> worlds;
    for (const int member : members) worlds.push_back(worlds_[static_cast<std::size_t>(member)]);
    return std::make_unique<LocalCommunicator>(office_, std::move(channel), std::move(worlds),
                                               static_cast<int>(mine - members.begin()), frame_);
  }
  [[nodiscard]] std::shared_ptr<PeerMemory> share(std::size_t bytes) override {
    std::vector<int> hosts;
    const int per_host = office_.ranks().ranks_per_host;
    for (const int world : worlds_) hosts.push_back(per_host > 0 ? world / per_host : 0);
    const std::size_t all = LocalPeerMemory::stride(bytes) * static_cast<std::size_t>(size_);
    return std::make_shared<LocalPeerMemory>(office_, office_.memory(channel_, shared_blocks_++, all, size_), bytes,
                                             rank_, std::move(hosts), frame_);
  }

 private:
  void put(const Channel& channel, std::span<const std::byte> message, int to) {
    HPR_CHECK(to >= 0 && to < size());
    office_.put({channel, rank_, to}, {{message.begin(), message.end()}, *frame_});
  }
  void take(const Channel& channel, std::span<std::byte> message, int from) {
    HPR_CHECK(from >= 0 && from < size());
    const Message arrived = office_.take({channel, from, rank_});
    check_frame(rank_, *frame_, from, arrived.frame);
    if (arrived.bytes.size() != message.size()) {
      throw Error(ExitCode::Internal, fmt::format("rank {} expected {} bytes from rank {}, got {}", rank_,
                                                  message.size(), from, arrived.bytes.size()));
    }
    std::ranges::copy(arrived.bytes, message.begin());
  }

  /// Lets other ranks go first now and then.
  void disturb() {
    if (office_.ranks().disorder != 0 && random_() % 4 == 0) {
      std::this_thread::sleep_for(std::chrono::microseconds(random_() % 64));
    }
  }

  PostOffice& office_;
  std::shared_ptr<std::uint64_t> frame_;  ///< one for all communicators of this rank
  Channel channel_;
  Channel reductions_;
  std::vector<int> worlds_;
  std::map<Channel, int> subsets_made_;
  int shared_blocks_ = 0;
  std::mt19937_64 random_;
  int rank_;
  int size_;
};

}  // namespace

void run_local_ranks(int size, const std::function<void(Communicator&)>& body, std::chrono::nanoseconds hang_timeout) {
  run_local_ranks({.size = size, .hang_timeout = hang_timeout}, body);
}

void run_local_ranks(const LocalRanks& ranks, const std::function<void(Communicator&)>& body) {
  const int size = ranks.size;
  HPR_CHECK(size > 0);
  PostOffice office(ranks);
  std::vector<int> worlds(static_cast<std::size_t>(size));
  std::iota(worlds.begin(), worlds.end(), 0);
  std::mutex mutex;
  std::exception_ptr first_failure;
  const auto run = [&](int rank) {
    LocalCommunicator comm(office, {}, worlds, rank, std::make_shared<std::uint64_t>(0));
    const trace::InRow row({rank, 0});
    try {
      body(comm);
    } catch (...) {
      {
        const std::lock_guard lock(mutex);
        if (!first_failure) first_failure = std::current_exception();
      }
      office.close();
    }
  };
  {
    std::vector<std::jthread> others;
    try {
      for (int rank = 1; rank < size; ++rank) others.emplace_back(run, rank);
    } catch (const std::system_error& error) {
      office.close();  // those that run already must not wait for those that never will
      throw Error(ExitCode::Limit, fmt::format("cannot start {} threads: {}", size, error.what()), "use fewer ranks");
    } catch (...) {
      office.close();
      throw;
    }
    run(0);  // on the caller's thread: a single rank starts no thread, and a GL context stays where it was made
  }
  if (first_failure) std::rethrow_exception(first_failure);
}

}  // namespace hpr
