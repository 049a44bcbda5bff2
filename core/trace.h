#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

/// Where the time goes: spans of what this process does, as trace viewers show them. Costs a look at a flag where
/// nobody records.
namespace hpr::trace {

/// Something that was done.
struct Event {
  std::string name;
  std::int64_t begin_ns = 0;  ///< of the process's steady clock
  std::int64_t end_ns = 0;
  int lane = 0;
  const char* detail = nullptr;  ///< what `amount` is; null: it says nothing
  std::uint64_t amount = 0;
};

/// Records from now on.
void start();
[[nodiscard]] bool recording();

/// What was recorded, in the order it ended, and nothing is from here on. Past kMostEvents none is taken any more.
struct Record {
  std::vector<Event> events;
  std::uint64_t dropped = 0;
};
[[nodiscard]] Record finish();
inline constexpr std::size_t kMostEvents = 1'000'000;

/// The time from here to the end of its life.
class Span {
 public:
  explicit Span(std::string_view name) : Span(name, nullptr, 0) {}
  /// `detail` must outlive the record: a literal.
  Span(std::string_view name, const char* detail, std::uint64_t amount);
  ~Span();
  Span(const Span&) = delete;
  Span& operator=(const Span&) = delete;

  /// For what is known at the end only.
  void tell(const char* detail, std::uint64_t amount) {
    event_.detail = detail;
    event_.amount = amount;
  }

 private:
  Event event_;
  bool records_;
};

/// While it lives, what this thread does stands in row `lane` of its process; 0 is the row of the main thread.
class Lane {
 public:
  explicit Lane(int lane);
  ~Lane();
  Lane(const Lane&) = delete;
  Lane& operator=(const Lane&) = delete;

 private:
  int before_;
};

/// Nanoseconds of the clock that events are timed by.
[[nodiscard]] std::int64_t now_ns();

}  // namespace hpr::trace
