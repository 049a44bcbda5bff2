#include "core/parallel.h"

#include <sched.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "core/job_board.h"
#include "core/timing.h"

namespace hpr {
namespace {

/// Threads that help one caller with its loops, and sleep in between.
class Team {
 public:
  Team() = default;
  Team(const Team&) = delete;
  Team& operator=(const Team&) = delete;
  ~Team() {
    {
      const std::lock_guard lock(mutex_);
      ended_ = true;
    }
    wake_.notify_all();
  }

  /// Calls work(0) here and work(1) to work(helpers) on other threads, but for those that have not yet begun when
  /// work(0) is done: nothing is left for them.
  void run(std::size_t helpers, const std::function<void(std::size_t)>& work) {
    {
      const std::lock_guard lock(mutex_);
      while (threads_.size() < helpers) threads_.emplace_back([this] { serve(); });
      work_ = &work;
      to_start_ = helpers;
    }
    for (std::size_t i = 0; i < helpers; ++i) wake_.notify_one();
    work(0);
    std::unique_lock lock(mutex_);
    to_start_ = 0;
    done_.wait(lock, [this] { return busy_ == 0; });
  }

 private:
  void serve() {
    std::unique_lock lock(mutex_);
    while (true) {
      wake_.wait(lock, [this] { return ended_ || to_start_ > 0; });
      if (ended_) return;
      const std::size_t number = to_start_--;
      ++busy_;
      const auto& work = *work_;
      lock.unlock();
      work(number);
      lock.lock();
      if (--busy_ == 0) done_.notify_one();
    }
  }

  std::mutex mutex_;
  std::condition_variable wake_;
  std::condition_variable done_;
  const std::function<void(std::size_t)>* work_ = nullptr;
  std::size_t to_start_ = 0;
  std::size_t busy_ = 0;
  bool ended_ = false;
  std::vector<std::jthread> threads_;  ///< last: they end before what they use
};

}  // namespace

int usable_cores() {
  cpu_set_t allowed;
  CPU_ZERO(&allowed);
  if (::sched_getaffinity(0, sizeof(allowed), &allowed) == 0) return std::max(1, CPU_COUNT(&allowed));
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

void parallel_for(int threads, std::size_t count, const std::function<void(std::size_t)>& body) {
  std::atomic<std::size_t> next = 0;
  std::mutex mutex;
  std::exception_ptr first_failure;
  const std::function<void(std::size_t)> work = [&, rank = trace::row_of_this_thread().rank](std::size_t number) {
    const trace::InRow row(number == 0 ? trace::row_of_this_thread() : trace::Row{rank, static_cast<int>(number)});
    try {
      for (std::size_t i = next++; i < count; i = next++) {
        body(i);
        report_step();  // a pass over a large frame is no standstill
      }
    } catch (...) {
      next = count;
      const std::lock_guard lock(mutex);
      if (!first_failure) first_failure = std::current_exception();
    }
  };
  const std::size_t runs = std::min<std::size_t>(static_cast<std::size_t>(std::max(threads, 1)), count);
  if (runs > 1) {
    thread_local Team team;
    team.run(runs - 1, work);
  } else {
    work(0);
  }
  if (first_failure) std::rethrow_exception(first_failure);
}

}  // namespace hpr
