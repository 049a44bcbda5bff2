#pragma once

#include <array>
#include <cstddef>

namespace hpr {

/// Seconds of this machine's monotonic clock.
[[nodiscard]] double link_seconds();

/// How far another machine's clock is ahead of this one's, from round trips: NTP's formula (RFC 5905), of the last few
/// the one that was quickest, as what a round trip lost in waiting it may have lost one way.
class ClockOffset {
 public:
  /// A question left at `sent` and its answer was here at `received`, by this clock; by the other one the question came
  /// at `arrived` and the answer left at `answered`.
  void add(double sent, double arrived, double answered, double received);

  [[nodiscard]] bool known() const { return count_ > 0; }
  /// Seconds: the other clock less this one. The error is at most half the round trip.
  [[nodiscard]] double seconds() const { return best().offset; }
  [[nodiscard]] double round_trip() const { return best().round_trip; }

 private:
  struct Sample {
    double offset = 0.0;
    double round_trip = 0.0;
  };
  [[nodiscard]] Sample best() const;

  std::array<Sample, 8> samples_{};
  std::size_t count_ = 0;  ///< ever
};

}  // namespace hpr
