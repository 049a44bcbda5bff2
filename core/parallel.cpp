#include "core/parallel.h"

#include <sched.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <ctime>
#include <exception>
#include <functional>
#include <mutex>
#include <numeric>
#include <queue>
#include <thread>
#include <vector>

#include "core/error.h"
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

thread_local LoopProfile* profile_of_this_thread = nullptr;

double process_ms() {
  timespec now{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

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
  const std::size_t runs = std::min<std::size_t>(static_cast<std::size_t>(std::max(threads, 1)), count);
  LoopProfile* const profile = runs > 1 ? profile_of_this_thread : nullptr;
  std::vector<float>* const body_ms = profile != nullptr ? &profile->begin_loop(count) : nullptr;
  const std::function<void(std::size_t)> work = [&, rank = trace::row_of_this_thread().rank](std::size_t number) {
    const trace::InRow row(number == 0 ? trace::row_of_this_thread() : trace::Row{rank, static_cast<int>(number)});
    try {
      for (std::size_t i = next++; i < count; i = next++) {
        const double begin_ms = body_ms != nullptr ? thread_ms() : 0.0;
        body(i);
        if (body_ms != nullptr) (*body_ms)[i] = static_cast<float>(thread_ms() - begin_ms);
        report_step();  // a pass over a large frame is no standstill
      }
    } catch (...) {
      next = count;
      const std::lock_guard lock(mutex);
      if (!first_failure) first_failure = std::current_exception();
    }
  };
  if (runs > 1) {
    thread_local Team team;
    team.run(runs - 1, work);
  } else {
    work(0);
  }
  if (profile != nullptr) profile->end_loop();
  if (first_failure) std::rethrow_exception(first_failure);
}

LoopProfile::LoopProfile() : resumed_ms_(thread_ms()), process_begin_ms_(process_ms()) {
  HPR_CHECK(profile_of_this_thread == nullptr);
  profile_of_this_thread = this;
}

LoopProfile::~LoopProfile() {
  finish();
}

void LoopProfile::finish() {
  if (profile_of_this_thread != this) return;
  profile_of_this_thread = nullptr;
  end_serial();
  process_ms_ = process_ms() - process_begin_ms_;
}

void LoopProfile::end_serial() {
  const double spent_ms = thread_ms() - resumed_ms_;
  serial_ms_ += spent_ms;
  serial_phases_[current_phase()] += spent_ms;
}

std::vector<float>& LoopProfile::begin_loop(std::size_t count) {
  end_serial();
  return loops_.emplace_back(count);
}

void LoopProfile::end_loop() {
  resumed_ms_ = thread_ms();
}

double LoopProfile::loops_ms() const {
  double sum = 0.0;
  for (const std::vector<float>& loop : loops_) sum = std::accumulate(loop.begin(), loop.end(), sum);
  return sum;
}

double LoopProfile::others_ms() const {
  return std::max(process_ms_ - serial_ms() - loops_ms(), 0.0);
}

double LoopProfile::even_ms(int threads) const {
  return serial_ms() + (loops_ms() + others_ms()) / threads;
}

double LoopProfile::scheduled_ms(int threads) const {
  double sum = serial_ms() + others_ms() / threads;
  for (const std::vector<float>& loop : loops_) {
    std::priority_queue<double, std::vector<double>, std::greater<>> cores;  // when each is free again
    for (int i = 0; i < threads; ++i) cores.push(0.0);
    double last = 0.0;
    for (const float body : loop) {
      const double done = cores.top() + static_cast<double>(body);
      cores.pop();
      cores.push(done);
      last = std::max(last, done);
    }
    sum += last;
  }
  return sum;
}

}  // namespace hpr
