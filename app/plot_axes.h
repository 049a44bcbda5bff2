#pragma once

#include <cmath>
#include <vector>

namespace hpr {

/// A logarithmic scale from `from` to `to` pixels of a plot.
class LogScale {
 public:
  LogScale(double least, double most, double from, double to)
      : least_(std::log10(least)), span_(std::log10(most) - least_), from_(from), to_(to) {}

  /// Wide enough for positive `values`, of which there is one at least, with some room at both ends.
  [[nodiscard]] static LogScale of(std::vector<double> values, double from, double to);

  [[nodiscard]] double at(double value) const { return from_ + (to_ - from_) * (std::log10(value) - least_) / span_; }

  /// Round values inside: 1, 2 and 5 of each power of ten, or powers alone where those are many: every second, third ..
  /// of them, so that there are never more than a dozen.
  [[nodiscard]] std::vector<double> ticks() const;

 private:
  double least_;
  double span_;
  double from_;
  double to_;
};

}  // namespace hpr
