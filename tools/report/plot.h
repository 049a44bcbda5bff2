#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tools/report/canvas.h"

namespace hpr {

/// How series `index` of a plot is drawn: colors of Tol's "muted" scheme, without those too light on white, each with
/// dashes, so that nothing depends on color alone. They repeat after ten.
struct SeriesStyle {
  std::string_view color;
  std::string_view dashes;
};
[[nodiscard]] const SeriesStyle& series_style(std::size_t index);

/// A label on an axis.
struct Tick {
  double position = 0.0;  ///< pixels, along the axis
  std::string label;      ///< empty: a grid line alone
};

/// A logarithmic scale from `from` to `to` pixels of a plot.
class LogScale {
 public:
  LogScale(double low, double high, double from, double to)
      : low_(std::log10(low)), span_(std::log10(high) - low_), from_(from), to_(to) {}

  /// Wide enough for positive `values`, of which there is one at least, with some room at both ends.
  [[nodiscard]] static LogScale of(std::vector<double> values, double from, double to);

  [[nodiscard]] double at(double value) const { return from_ + (to_ - from_) * (std::log10(value) - low_) / span_; }

  /// Round values inside: 1, 2 and 5 of each power of ten, or powers alone where those are many: every second, third ..
  /// of them, so that there are never more than a dozen.
  [[nodiscard]] std::vector<double> round_values() const;
  /// The round values with their labels.
  [[nodiscard]] std::vector<Tick> ticks() const;

 private:
  /// Round values of narrow spans: every digit of each power of ten, and halves of the smaller ones.
  [[nodiscard]] std::vector<double> close_values() const;

  double low_;
  double span_;
  double from_;
  double to_;
};

/// Where a plot's field lies on its canvas, in pixels.
struct PlotLayout {
  double width = 940.0;
  double height = 470.0;
  double left = 78.0;
  double right = 760.0;  ///< of the field; names of series stand to the right of it
  double top = 18.0;
  double bottom = 410.0;
  double x_name_below = 42.0;  ///< from the field's bottom to the name of the x axis
  double y_name_at = 22.0;     ///< where the name of the y axis stands, from the left
};

/// A canvas with a field, its grid and axes, which a report draws its series into.
class Plot {
 public:
  Plot(const PlotLayout& layout, std::string_view title, std::string_view description)
      : layout_(layout), canvas_(layout.width, layout.height, title, description) {}

  [[nodiscard]] SvgCanvas& canvas() { return canvas_; }

  void draw_x_ticks(std::span<const Tick> ticks);
  void draw_y_ticks(std::span<const Tick> ticks);
  void draw_axis_lines();
  void name_x_axis(std::string_view name);
  void name_y_axis(std::string_view name);

  [[nodiscard]] std::string str() const { return canvas_.str(); }

 private:
  PlotLayout layout_;
  SvgCanvas canvas_;
};

}  // namespace hpr
