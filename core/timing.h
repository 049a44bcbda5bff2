#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace hpr {

/// Wall time since it was made or last restarted.
class Stopwatch {
 public:
  [[nodiscard]] double ms() const {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start_).count();
  }
  void restart() { start_ = std::chrono::steady_clock::now(); }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// CPU time of this thread in ms: what other processes do disturbs it less than the time on a clock.
[[nodiscard]] double thread_ms();

/// That, since it was made.
class CpuStopwatch {
 public:
  [[nodiscard]] double ms() const { return thread_ms() - start_ms_; }

 private:
  double start_ms_ = thread_ms();
};

}  // namespace hpr

/// Spans of what this process does, as trace viewers show them and its launcher is told (core/job_board.h). Costs a few
/// stores while nothing records.
namespace hpr::trace {

/// Something that was done. Texts are literals.
struct Event {
  const char* name = "";
  std::int64_t begin_ns = 0;  ///< of the process's steady clock
  std::int64_t end_ns = 0;
  int rank = 0;  ///< where ranks are threads of one process; else 0
  int lane = 0;
  const char* detail = nullptr;  ///< what `amount` is; null: it says nothing
  std::uint64_t amount = 0;
};

struct Record {
  std::vector<Event> events;  ///< in the order they ended
  std::uint64_t dropped = 0;  ///< past kMaxEvents
};
inline constexpr std::size_t kMaxEvents = 1'000'000;

/// Records what ends from now on; an earlier record is lost.
void start();
[[nodiscard]] bool recording();
/// Ends the recording and hands it over.
[[nodiscard]] Record finish();

/// The time from here to the end of its life.
class Span {
 public:
  explicit Span(const char* name) : Span(name, nullptr, 0) {}
  Span(const char* name, const char* detail, std::uint64_t amount);
  ~Span();
  Span(const Span&) = delete;
  Span& operator=(const Span&) = delete;

  /// Sets what is known at the end only. `detail` is a literal: what `amount` counts.
  void set_detail(const char* detail, std::uint64_t amount) {
    event_.detail = detail;
    event_.amount = amount;
  }

 private:
  Event event_;
  const char* around_;  ///< the phase before
  bool records_;
};

/// Whose work a thread does: a rank, where ranks are threads, and one of that rank's threads; 0 is its main one.
struct Row {
  int rank = 0;
  int lane = 0;
};
[[nodiscard]] Row row_of_this_thread();

/// The lane of what a device does for a rank: past all threads, and the one that shows pictures.
inline constexpr int kDeviceLane = 1026;

/// Adds what was done in that lane for this thread's rank, and timed otherwise. In one lane, spans do not overlap in
/// part. `name` may be any text.
void add_device_span(const std::string& name, std::int64_t begin_ns, std::int64_t end_ns);

/// While it lives, what this thread does stands in that row.
class InRow {
 public:
  explicit InRow(Row row);
  ~InRow();
  InRow(const InRow&) = delete;
  InRow& operator=(const InRow&) = delete;

 private:
  Row before_;
};

/// Nanoseconds of the clock that events are timed by.
[[nodiscard]] std::int64_t now_ns();

}  // namespace hpr::trace
