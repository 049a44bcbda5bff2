#pragma once

#include <cmath>
#include <string_view>
#include <vector>

#include "tools/report/markup.h"

namespace hpr {

/// What all plots of reports have in common.
inline constexpr Stroke kGridStroke{"#dddddd", 1.0};
inline constexpr Stroke kAxisStroke{"#444444", 1.0};

/// How series `index` of a plot looks: colors of Tol's "muted" scheme, without those too light on white, each with
/// dashes, so that nothing hangs on color alone. After ten they begin again.
struct SeriesLook {
  std::string_view color;
  std::string_view dashes;
};
[[nodiscard]] const SeriesLook& series_look(std::size_t index);

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
  /// For narrow spans: every digit of each power of ten, and halves of the smaller ones.
  [[nodiscard]] std::vector<double> close_ticks() const;

  double least_;
  double span_;
  double from_;
  double to_;
};

}  // namespace hpr
