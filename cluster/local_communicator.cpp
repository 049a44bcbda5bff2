#include "cluster/local_communicator.h"

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <system_error>
#include <thread>

#include "core/check.h"
#include "core/error.h"

namespace hpr {
namespace {

using Message = std::vector<std::byte>;

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

/// All messages on their way between the ranks of this process.
class PostOffice {
 public:
  explicit PostOffice(std::chrono::nanoseconds hang_timeout) : hang_timeout_(std::min(hang_timeout, kLongestWait)) {}

  void put(const Route& route, Message message) {
    const std::lock_guard lock(mutex_);
    boxes_[route].push_back(std::move(message));
    arrived_.notify_all();
  }

  Message take(const Route& route) {
    std::unique_lock lock(mutex_);
    auto& box = boxes_[route];
    const bool in_time = arrived_.wait_for(lock, hang_timeout_, [&] { return closed_ || !box.empty(); });
    if (box.empty()) {
      if (in_time) throw Error(ExitCode::Lost, fmt::format("rank {}: a peer failed", route.to));
      throw Error(ExitCode::Hang,
                  fmt::format("rank {}: no message from rank {} within the time limit", route.to, route.from),
                  "a rank stands still; raise --hang-timeout if it only needs longer");
    }
    Message message = std::move(box.front());
    box.pop_front();
    return message;
  }

  void close() {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    arrived_.notify_all();
  }

 private:
  std::chrono::nanoseconds hang_timeout_;
  std::mutex mutex_;
  std::condition_variable arrived_;
  std::map<Route, std::deque<Message>> boxes_;
  bool closed_ = false;
};

class LocalCommunicator final : public Communicator {
 public:
  LocalCommunicator(PostOffice& office, Channel channel, int rank, int size)
      : office_(office), channel_(std::move(channel)), rank_(rank), size_(size) {
    // What a reduction sends must not meet a message that was sent before it and is received after it.
    reductions_ = channel_;
    reductions_.push_back(-2);
  }

  [[nodiscard]] int rank() const override { return rank_; }
  [[nodiscard]] int size() const override { return size_; }
  [[nodiscard]] std::string_view transport() const override { return "threads"; }

  void send(std::span<const std::byte> message, int to) override { put(channel_, message, to); }
  void receive(std::span<std::byte> message, int from) override { take(channel_, message, from); }
  [[nodiscard]] std::vector<std::byte> receive(int from) override {
    HPR_CHECK(from >= 0 && from < size());
    return office_.take({channel_, from, rank_});
  }
  [[nodiscard]] std::vector<std::byte> exchange(std::span<const std::byte> out, int peer) override {
    send(out, peer);
    return receive(peer);
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
    return std::make_unique<LocalCommunicator>(office_, std::move(channel), static_cast<int>(mine - members.begin()),
                                               static_cast<int>(members.size()));
  }

 private:
  void put(const Channel& channel, std::span<const std::byte> message, int to) {
    HPR_CHECK(to >= 0 && to < size());
    office_.put({channel, rank_, to}, Message(message.begin(), message.end()));
  }
  void take(const Channel& channel, std::span<std::byte> message, int from) {
    HPR_CHECK(from >= 0 && from < size());
    const Message arrived = office_.take({channel, from, rank_});
    if (arrived.size() != message.size()) {
      throw Error(ExitCode::Internal, fmt::format("rank {} expected {} bytes from rank {}, got {}", rank_,
                                                  message.size(), from, arrived.size()));
    }
    std::ranges::copy(arrived, message.begin());
  }

  PostOffice& office_;
  Channel channel_;
  Channel reductions_;
  std::map<Channel, int> subsets_made_;
  int rank_;
  int size_;
};

}  // namespace

void run_local_ranks(int size, const std::function<void(Communicator&)>& body, std::chrono::nanoseconds hang_timeout) {
  HPR_CHECK(size > 0);
  PostOffice office(hang_timeout);
  std::mutex mutex;
  std::exception_ptr first_failure;
  const auto run = [&](int rank) {
    LocalCommunicator comm(office, {}, rank, size);
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
    }
    run(0);  // on the caller's thread: a single rank starts no thread, and a GL context stays where it was made
  }
  if (first_failure) std::rethrow_exception(first_failure);
}

}  // namespace hpr
