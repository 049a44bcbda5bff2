#include "walls/link/clock.h"

#include <algorithm>
#include <chrono>
#include <span>

namespace hpr {

double link_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

void ClockOffset::add(double sent, double arrived, double answered, double received) {
  const double round_trip = std::max(0.0, (received - sent) - (answered - arrived));
  samples_.at(count_ % samples_.size()) = {((arrived - sent) + (answered - received)) / 2.0, round_trip};
  ++count_;
}

ClockOffset::Sample ClockOffset::best() const {
  if (count_ == 0) return {};
  return std::ranges::min(std::span(samples_).first(std::min(count_, samples_.size())), {}, &Sample::round_trip);
}

}  // namespace hpr
