#include "core/parallel.h"

#include <sched.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "core/job_board.h"
#include "core/timing.h"

namespace hpr {

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
  const auto work = [&] {
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
  {
    const std::size_t helpers = std::min<std::size_t>(static_cast<std::size_t>(std::max(threads, 1)), count);
    std::vector<std::jthread> team;
    for (std::size_t i = 1; i < helpers; ++i) {
      team.emplace_back([&work, i, rank = trace::row_of_this_thread().rank] {
        const trace::InRow row({rank, static_cast<int>(i)});
        work();
      });
    }
    work();
  }
  if (first_failure) std::rethrow_exception(first_failure);
}

}  // namespace hpr
