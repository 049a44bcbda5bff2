#pragma once

#include <memory>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

namespace hpr {

/// Memory that is kept from use to use: fresh pages would cost a tenth of the time. Any thread may take some.
template <typename Scratch>
class ScratchPool {
 public:
  /// What is made anew is made of `arguments`.
  template <typename... Arguments>
  [[nodiscard]] std::unique_ptr<Scratch> take(const Arguments&... arguments) {
    const std::lock_guard lock(mutex_);
    if (idle_.empty()) return std::make_unique<Scratch>(arguments...);
    std::unique_ptr<Scratch> scratch = std::move(idle_.back());
    idle_.pop_back();
    return scratch;
  }
  void put_back(std::unique_ptr<Scratch> scratch) {
    const std::lock_guard lock(mutex_);
    idle_.push_back(std::move(scratch));
  }
  /// All of it, while no thread has any.
  [[nodiscard]] std::span<const std::unique_ptr<Scratch>> all() const { return idle_; }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<Scratch>> idle_;
};

}  // namespace hpr
