#include "core/interrupt.h"

namespace hpr {

bool Interrupt::is_raised() {
  constexpr double kBetweenPolls_ms = 5.0;
  if (raised_) return true;
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock || raised_ || (has_polled_ && since_poll_.ms() < kBetweenPolls_ms)) return raised_;
  raised_ = poll_();
  has_polled_ = true;
  since_poll_.restart();
  return raised_;
}

}  // namespace hpr
