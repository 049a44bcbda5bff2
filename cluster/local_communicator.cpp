#include "cluster/local_communicator.h"

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <exception>
#include <map>
#include <mutex>
#include <thread>

#include "core/check.h"
#include "core/error.h"

namespace hpr {
namespace {

using Message = std::vector<std::byte>;

/// Who sends to whom, in which communicator: world ranks, and the ranks of the communicator ("" is the world).
struct Route {
  std::vector<int> members;
  int from;
  int to;

  auto operator<=>(const Route&) const = default;
};

/// All messages on their way between the ranks of this process.
class PostOffice {
 public:
  explicit PostOffice(std::chrono::nanoseconds hang_timeout) : hang_timeout_(hang_timeout) {}

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
  /// `members`: the world ranks of this communicator, in its order.
  LocalCommunicator(PostOffice& office, std::vector<int> members, int rank)
      : office_(office), members_(std::move(members)), rank_(rank) {}

  [[nodiscard]] int rank() const override { return rank_; }
  [[nodiscard]] int size() const override { return static_cast<int>(members_.size()); }
  [[nodiscard]] std::string_view transport() const override { return "threads"; }

  void send(std::span<const std::byte> message, int to) override {
    HPR_CHECK(to >= 0 && to < size());
    office_.put({members_, rank_, to}, Message(message.begin(), message.end()));
  }
  void receive(std::span<std::byte> message, int from) override {
    const Message arrived = receive(from);
    if (arrived.size() != message.size()) {
      throw Error(ExitCode::Internal, fmt::format("rank {} expected {} bytes from rank {}, got {}", rank_,
                                                  message.size(), from, arrived.size()));
    }
    std::ranges::copy(arrived, message.begin());
  }
  [[nodiscard]] std::vector<std::byte> receive(int from) override {
    HPR_CHECK(from >= 0 && from < size());
    return office_.take({members_, from, rank_});
  }
  [[nodiscard]] std::vector<std::byte> exchange(std::span<const std::byte> out, int peer) override {
    send(out, peer);
    return receive(peer);
  }
  void reduce_max(std::span<std::uint64_t> values, int root) override {
    if (rank_ != root) {
      send(std::as_bytes(values), root);
      return;
    }
    std::vector<std::uint64_t> other(values.size());
    for (int from = 0; from < size(); ++from) {
      if (from == root) continue;
      receive(std::as_writable_bytes(std::span(other)), from);
      std::ranges::transform(values, other, values.begin(),
                             [](std::uint64_t a, std::uint64_t b) { return std::max(a, b); });
    }
  }
  [[nodiscard]] std::unique_ptr<Communicator> subset(std::span<const int> members) override {
    std::vector<int> world;
    for (const int member : members) world.push_back(members_.at(static_cast<std::size_t>(member)));
    const auto mine = std::ranges::find(members, rank_);
    HPR_CHECK(mine != members.end());
    return std::make_unique<LocalCommunicator>(office_, std::move(world), static_cast<int>(mine - members.begin()));
  }

 private:
  PostOffice& office_;
  std::vector<int> members_;
  int rank_;
};

}  // namespace

void run_local_ranks(int size, const std::function<void(Communicator&)>& body, std::chrono::nanoseconds hang_timeout) {
  HPR_CHECK(size > 0);
  PostOffice office(hang_timeout);
  std::vector<int> members;
  for (int rank = 0; rank < size; ++rank) members.push_back(rank);
  std::mutex mutex;
  std::exception_ptr first_failure;
  const auto run = [&](int rank) {
    LocalCommunicator comm(office, members, rank);
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
    for (int rank = 1; rank < size; ++rank) others.emplace_back(run, rank);
    run(0);  // on the caller's thread: a single rank starts no thread, and a GL context stays where it was made
  }
  if (first_failure) std::rethrow_exception(first_failure);
}

}  // namespace hpr
