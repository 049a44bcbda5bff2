#include "tools/tradeoff/tradeoff_plots.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string_view>

#include "tools/report/markup.h"
#include "tools/report/plot_axes.h"
#include "tools/tradeoff/tradeoff_report.h"

namespace hpr {
namespace {

constexpr double kWidth = 940.0;
constexpr double kHeight = 430.0;
constexpr double kLeft = 86.0;
constexpr double kRight = 680.0;  ///< of the field; names stand to the right of it
constexpr double kTop = 18.0;
constexpr double kBottom = 370.0;
constexpr Stroke kFront{"#d8c070", 6.0};

/// A point with a place in the plot.
struct Dot {
  std::size_t number = 0;
  Point at;
  bool pareto = false;
};

/// All knobs but the last one: what the points of a line share.
KnobValues line_of(const TradeoffPoint& point) {
  KnobValues shared = point.knobs;
  if (shared.size() > 1) shared.pop_back();
  return point.knobs.size() > 1 ? shared : KnobValues{};
}

std::string axis_name(const std::string& metric) {
  if (metric == "ssim") return "1 - SSIM";
  if (metric == "psnr") return "RMSE of display values (10^(-PSNR / 20))";
  if (metric == "relmse") return "relMSE, without the worst 0.1 %";
  return metric == "flip" ? "FLIP" : "RMSE";
}

void draw_axes(SvgDrawing& drawing, const LogScale& x, const LogScale& y, const std::string& metric) {
  for (const double value : y.ticks()) {
    drawing.line({kLeft, y.at(value)}, {kRight, y.at(value)}, kGridStroke);
    drawing.text({kLeft - 8, y.at(value) + 4}, fmt::format("{:g}", value), Anchor::End);
  }
  for (const double value : x.ticks()) {
    drawing.line({x.at(value), kTop}, {x.at(value), kBottom}, kGridStroke);
    drawing.text({x.at(value), kBottom + 18}, fmt::format("{:g}", value), Anchor::Middle);
  }
  drawing.line({kLeft, kTop}, {kLeft, kBottom}, kAxisStroke);
  drawing.line({kLeft, kBottom}, {kRight, kBottom}, kAxisStroke);
  drawing.text({(kLeft + kRight) / 2, kBottom + 42}, "ms of a frame, slowest rank", Anchor::Middle, 13);
  drawing.upright_text({18, (kTop + kBottom) / 2}, axis_name(metric), 13);
}

void draw_line(SvgDrawing& drawing, const std::vector<Dot>& dots, const Stroke& stroke) {
  std::string points;
  for (const Dot& dot : dots) points += fmt::format("{:.1f},{:.1f} ", dot.at.x, dot.at.y);
  if (dots.size() > 1) drawing.polyline(points, stroke);
}

/// Points that can be drawn have a time and an error, neither of them 0.
bool can_be_drawn(const TradeoffPoint& point, const std::string& metric) {
  const double error = badness(metric, point.error.of(metric));
  return std::isfinite(error) && error > 0.0 && point.median_ms() > 0.0;
}

/// One line of points, and its name where there is room; `look`: its place among all.
void draw_series(SvgDrawing& drawing, const std::vector<Dot>& dots, const std::string& name, std::size_t look) {
  const SeriesLook& style = series_look(look);
  draw_line(drawing, dots, {style.color, 1.6, style.dashes});
  for (const Dot& dot : dots) {
    drawing.circle(dot.at, 4.4, dot.pareto ? style.color : "#ffffff", {style.color, 1.5});
    drawing.text({dot.at.x + 6, dot.at.y - 5}, fmt::format("{}", dot.number), Anchor::Start, 10);
  }
  const double height = kTop + 12 + 18.0 * static_cast<double>(look);
  if (name.empty() || height > kBottom) return;
  drawing.line({kRight + 14, height - 4}, {kRight + 40, height - 4}, {style.color, 1.6, style.dashes});
  drawing.text({kRight + 46, height}, name);
}

}  // namespace

std::string plot_error_over_time(const TradeoffReport& report, const std::string& metric) {
  std::vector<double> times;
  std::vector<double> errors;
  const auto error_of = [&](const TradeoffPoint& point) { return badness(metric, point.error.of(metric)); };
  for (const TradeoffPoint& point : report.points) {
    if (!can_be_drawn(point, metric)) continue;
    times.push_back(point.median_ms());
    errors.push_back(error_of(point));
  }
  if (times.empty()) return {};
  const LogScale x = LogScale::of(times, kLeft + 16, kRight - 16);
  const LogScale y = LogScale::of(errors, kBottom - 8, kTop + 8);
  SvgDrawing drawing(kWidth, kHeight, fmt::format("{} over time", axis_name(metric)),
                     "Each number is a row of the table; the broad line joins what nothing else beats.");
  draw_axes(drawing, x, y, metric);

  std::vector<KnobValues> order;
  std::map<KnobValues, std::vector<Dot>> lines;
  std::vector<Dot> front;
  for (std::size_t i = 0; i < report.points.size(); ++i) {
    const TradeoffPoint& point = report.points[i];
    if (!can_be_drawn(point, metric)) continue;
    const KnobValues line = line_of(point);
    if (std::ranges::find(order, line) == order.end()) order.push_back(line);
    const Dot dot{i + 1, {x.at(point.median_ms()), y.at(error_of(point))}, point.pareto};
    lines[line].push_back(dot);
    if (point.pareto) front.push_back(dot);
  }
  std::ranges::sort(front, {}, [](const Dot& dot) { return dot.at.x; });
  if (metric == report.metrics.front()) draw_line(drawing, front, kFront);
  for (std::size_t i = 0; i < order.size(); ++i) draw_series(drawing, lines.at(order[i]), describe(order[i]), i);
  return drawing.str();
}

std::string plot_shares_of_passes(const TradeoffReport& report) {
  constexpr double kPitch = 20.0;
  std::vector<std::string> names;
  for (const TradeoffPoint& point : report.points) {
    for (const PassTime& time : point.times) {
      if (time.ms > 0.0 && std::ranges::find(names, time.name) == names.end()) names.push_back(time.name);
    }
  }
  const double height = kTop + kPitch * static_cast<double>(std::max(report.points.size(), names.size())) + 10;
  SvgDrawing drawing(kWidth, height, "Where the time of each point goes",
                     "Shares of the passes; times of threads are added up.");
  for (std::size_t i = 0; i < report.points.size(); ++i) {
    const TradeoffPoint& point = report.points[i];
    double sum = 0.0;
    for (const PassTime& time : point.times) sum += time.ms;
    const double top = kTop + kPitch * static_cast<double>(i);
    drawing.text({kLeft - 8, top + 11}, fmt::format("{}: {:.1f} ms", i + 1, point.median_ms()), Anchor::End, 11);
    double left = kLeft;
    for (std::size_t name = 0; name < names.size() && sum > 0.0; ++name) {
      const auto found = std::ranges::find(point.times, names[name], &PassTime::name);
      if (found == point.times.end()) continue;
      const double width = (kRight - kLeft) * found->ms / sum;
      drawing.rectangle({left, top}, width, kPitch - 5, series_look(name).color, {"#ffffff", 0.5});
      left += width;
    }
  }
  for (std::size_t name = 0; name < names.size(); ++name) {
    const double top = kTop + kPitch * static_cast<double>(name);
    drawing.rectangle({kRight + 14, top}, 14, kPitch - 7, series_look(name).color, {"#ffffff", 0.5});
    drawing.text({kRight + 34, top + 11}, names[name]);
  }
  return drawing.str();
}

}  // namespace hpr
