#include "core/timing.h"

#include <atomic>
#include <chrono>
#include <ctime>
#include <functional>
#include <mutex>
#include <set>
#include <string>
#include <utility>

#include "core/job_board.h"

namespace hpr {

double thread_ms() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

}  // namespace hpr

namespace hpr::trace {
namespace {

std::atomic<bool> on = false;
std::mutex mutex;
Record record;  // NOLINT(cert-err58-cpp): an empty vector

thread_local Row this_row;

void add(const Event& event) {
  const std::lock_guard lock(mutex);
  if (!on.load()) return;
  if (record.events.size() >= kMaxEvents) {
    ++record.dropped;
  } else {
    record.events.push_back(event);
  }
}

}  // namespace

std::int64_t now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

void start() {
  const std::lock_guard lock(mutex);
  record = {};
  on.store(true);
}

bool recording() {
  return on.load(std::memory_order_relaxed);
}

Record finish() {
  on.store(false);
  const std::lock_guard lock(mutex);
  return std::exchange(record, {});
}

Span::Span(const char* name, const char* detail, std::uint64_t amount)
    : around_(current_phase()), records_(recording()) {
  report_phase(name);
  report_step();
  if (!records_) return;
  event_ = {name, now_ns(), 0, this_row.rank, this_row.lane, detail, amount};
}

Span::~Span() {
  report_phase(around_);
  if (!records_) return;
  event_.end_ns = now_ns();
  add(event_);
}

void add_device_span(const std::string& name, std::int64_t begin_ns, std::int64_t end_ns) {
  if (!recording()) return;
  static std::set<std::string, std::less<>> names;  // that events point at
  const char* kept = nullptr;
  {
    const std::lock_guard lock(mutex);
    kept = names.insert(name).first->c_str();
  }
  add({kept, begin_ns, end_ns, this_row.rank, kDeviceLane});
}

Row row_of_this_thread() {
  return this_row;
}

InRow::InRow(Row row) : before_(std::exchange(this_row, row)) {}

InRow::~InRow() {
  this_row = before_;
}

}  // namespace hpr::trace
