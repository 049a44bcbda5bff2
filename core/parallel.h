#pragma once

#include <cstddef>
#include <deque>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace hpr {

/// The cores this process may run on: its affinity mask, which launchers and containers make smaller than the machine.
[[nodiscard]] int usable_cores();

/// Calls body(i) for i in [0, count), by up to `threads` threads (the caller is one of them), in any order; returns
/// when all are done. Rethrows the first exception a call left. Bodies must not call parallel_for: one level, one
/// budget. The other threads belong to the caller: they sleep until its next loop, and end with it.
void parallel_for(int threads, std::size_t count, const std::function<void(std::size_t)>& body);

/// What the thread that made it does from then on, by processor time: in its loops of several threads body by body, and
/// outside of them. From that follows how its work spreads over any number of cores, whatever else the machine does.
class LoopProfile {
 public:
  LoopProfile();
  ~LoopProfile();
  LoopProfile(const LoopProfile&) = delete;
  LoopProfile& operator=(const LoopProfile&) = delete;

  /// Ends it; the figures below are for then.
  void finish();

  /// This thread's, outside of loops.
  [[nodiscard]] double serial_ms() const { return serial_ms_; }
  /// That, up to each loop, or to the end, by the phase (trace::Span) of then.
  [[nodiscard]] const std::map<std::string, double>& serial_phases() const { return serial_phases_; }
  /// All bodies of loops.
  [[nodiscard]] double loops_ms() const;
  /// Threads of libraries, such as a software OpenGL's.
  [[nodiscard]] double others_ms() const;
  [[nodiscard]] double all_ms() const { return serial_ms() + loops_ms() + others_ms(); }

  /// The least time on so many cores: what is serial, and the rest shared out evenly (Amdahl 1967).
  [[nodiscard]] double even_ms(int threads) const;
  /// That with loops as they are: each core takes the next body once it is done with one, and a loop lasts until its
  /// last body is done.
  [[nodiscard]] double scheduled_ms(int threads) const;

 private:
  friend void parallel_for(int threads, std::size_t count, const std::function<void(std::size_t)>& body);
  /// A loop begins; where its bodies put their times.
  std::vector<float>& begin_loop(std::size_t count);
  void end_loop();
  void end_serial();

  double resumed_ms_;  ///< when this thread's last loop ended
  double process_begin_ms_;
  double process_ms_ = 0.0;
  double serial_ms_ = 0.0;
  std::map<std::string, double> serial_phases_;
  std::deque<std::vector<float>> loops_;
};

}  // namespace hpr
