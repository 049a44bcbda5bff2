#include "tools/compare/compare_plots.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <set>

#include "tools/report/markup.h"
#include "tools/report/plot_axes.h"

namespace hpr {
namespace {

constexpr double kWidth = 940.0;
constexpr double kHeight = 470.0;
constexpr double kLeft = 78.0;
constexpr double kRight = 760.0;  ///< of the field; names stand to the right of it
constexpr double kTop = 18.0;
constexpr double kBottom = 410.0;
constexpr double kNothingSent = 120.0;  ///< where runs without bytes stand
constexpr double kLabelPitch = 16.0;    ///< where there is room

enum class Mark { Circle, Square, Triangle, Diamond, Wedge };

/// How a strategy looks.
struct Look {
  std::string_view color;
  Mark mark;
  std::string_view dashes;
};

Look look(std::size_t index) {
  constexpr std::array<Mark, 5> kMarks{Mark::Circle, Mark::Square, Mark::Triangle, Mark::Diamond, Mark::Wedge};
  const SeriesLook& series = series_look(index);
  return {series.color, kMarks.at(index % kMarks.size()), series.dashes};
}

std::vector<std::string> strategies_of(const std::vector<CompareRun>& runs) {
  std::vector<std::string> names;
  for (const CompareRun& run : runs) {
    if (std::ranges::find(names, run.strategy) == names.end()) names.push_back(run.strategy);
  }
  return names;
}

std::vector<CompareRun> runs_of(const std::vector<CompareRun>& runs, const std::string& strategy) {
  std::vector<CompareRun> some;
  std::ranges::copy_if(runs, std::back_inserter(some), [&](const CompareRun& run) { return run.strategy == strategy; });
  std::ranges::stable_sort(some, {}, &CompareRun::ranks);
  return some;
}

std::string corners(std::initializer_list<Point> points) {
  std::string text;
  for (const Point& point : points) text += fmt::format("{:.1f},{:.1f} ", point.x, point.y);
  return text;
}

void draw_mark(SvgDrawing& drawing, const Look& look, Point at, bool hollow = false) {
  constexpr double kRadius = 4.6;
  const auto fill = hollow ? std::string_view("#ffffff") : look.color;
  const Stroke stroke{look.color, hollow ? 1.6 : 0.5};
  const double left = at.x - kRadius;
  const double right = at.x + kRadius;
  const double top = at.y - kRadius;
  const double bottom = at.y + kRadius;
  switch (look.mark) {
    case Mark::Circle:
      return drawing.circle(at, kRadius, fill, stroke);
    case Mark::Square:
      return drawing.rectangle({left, top}, 2 * kRadius, 2 * kRadius, fill, stroke);
    case Mark::Triangle:
      return drawing.polygon(corners({{left, bottom}, {right, bottom}, {at.x, top}}), fill, stroke);
    case Mark::Wedge:
      return drawing.polygon(corners({{left, top}, {right, top}, {at.x, bottom}}), fill, stroke);
    case Mark::Diamond:
      return drawing.polygon(corners({{left - 1, at.y}, {at.x, top - 1}, {right + 1, at.y}, {at.x, bottom + 1}}), fill,
                             stroke);
  }
}

/// Every time that is drawn.
std::vector<double> times_of(const std::vector<CompareRun>& runs) {
  std::vector<double> times;
  for (const CompareRun& run : runs) {
    for (const double ms : {run.ms.min, run.ms.median, run.ms.p95, run.predicted_ms.value_or(0.0)}) {
      if (ms > 0.0) times.push_back(ms);
    }
  }
  if (times.empty()) times.push_back(1.0);
  return times;
}

void draw_time_axis(SvgDrawing& drawing, const LogScale& times) {
  for (const double ms : times.ticks()) {
    drawing.line({kLeft, times.at(ms)}, {kRight, times.at(ms)}, kGridStroke);
    drawing.text({kLeft - 8, times.at(ms) + 4}, fmt::format("{:g}", ms), Anchor::End);
  }
  drawing.upright_text({22, (kTop + kBottom) / 2}, "ms of a frame, slowest rank", 13);
  drawing.line({kLeft, kTop}, {kLeft, kBottom}, kAxisStroke);
  drawing.line({kLeft, kBottom}, {kRight, kBottom}, kAxisStroke);
}

void draw_tick_below(SvgDrawing& drawing, double x, const std::string& text) {
  drawing.line({x, kTop}, {x, kBottom}, kGridStroke);
  drawing.text({x, kBottom + 18}, text, Anchor::Middle);
}

/// A strategy's name to the right of the field, and the mark it belongs to.
struct Label {
  Point of;  ///< the mark in the field
  std::size_t look = 0;
  std::string name;
};

/// Names as near to the heights of their marks as they can stand without touching.
void draw_labels(SvgDrawing& drawing, std::vector<Label> labels, bool lead_to_marks) {
  std::ranges::stable_sort(labels, {}, [](const Label& label) { return label.of.y; });
  const double pitch = std::min(kLabelPitch, (kBottom - kTop) / static_cast<double>(labels.size()));
  std::vector<double> heights;
  double free = kTop + 6;
  for (const Label& label : labels) {
    heights.push_back(std::max(free, label.of.y));
    free = heights.back() + pitch;
  }
  double room = kBottom;
  for (std::size_t i = labels.size(); i-- > 0; room -= pitch) {
    heights[i] = std::min(heights[i], room);
    room = heights[i];
  }
  for (std::size_t i = 0; i < labels.size(); ++i) {
    const Look style = look(labels[i].look);
    if (lead_to_marks) {
      drawing.line({labels[i].of.x + 6, labels[i].of.y}, {kRight + 8, heights[i]}, {style.color, 0.6, "1 2"});
    }
    draw_mark(drawing, style, {kRight + 16, heights[i]});
    drawing.text({kRight + 26, heights[i] + 4}, labels[i].name);
  }
}

/// Whiskers, medians, predictions and the line through them of one strategy. Returns where it ends.
Point draw_strategy(SvgDrawing& drawing, const std::vector<CompareRun>& runs, const Look& style, const LogScale& ranks,
                    const LogScale& times, double aside) {
  std::string points;
  for (const CompareRun& run : runs) {
    if (run.ms.median <= 0.0) continue;
    points += fmt::format("{:.1f},{:.1f} ", ranks.at(run.ranks) + aside, times.at(run.ms.median));
  }
  drawing.polyline(points, {style.color, 1.8, style.dashes});
  Point last{kLeft, kBottom};
  for (const CompareRun& run : runs) {
    const double x = ranks.at(run.ranks) + aside;
    if (run.predicted_ms.value_or(0.0) > 0.0) draw_mark(drawing, style, {x, times.at(*run.predicted_ms)}, true);
    if (run.ms.min <= 0.0) continue;
    const double top = times.at(run.ms.p95);
    const double bottom = times.at(run.ms.min);
    drawing.line({x, top}, {x, bottom}, {style.color, 1.0});
    for (const double y : {top, bottom}) drawing.line({x - 3, y}, {x + 3, y}, {style.color, 1.0});
    last = {x, times.at(run.ms.median)};
    draw_mark(drawing, style, last);
  }
  return last;
}

void draw_bytes_axis(SvgDrawing& drawing, const LogScale& bytes, bool some_send_nothing) {
  for (const double tick : bytes.ticks()) draw_tick_below(drawing, bytes.at(tick), fmt::format("{:g}", tick));
  if (some_send_nothing) {
    draw_tick_below(drawing, kNothingSent, "0");
    drawing.line({kNothingSent + 30, kTop}, {kNothingSent + 30, kBottom}, {"#444444", 1.0, "2 4"});
  }
  drawing.text({(kLeft + kRight) / 2, kBottom + 42}, "MB sent for a frame, all ranks", Anchor::Middle, 13);
}

/// The runs of strategy number `index`, each with its number of ranks. Returns where the last one stands.
Point draw_marks(SvgDrawing& drawing, const std::vector<CompareRun>& runs, std::size_t index, const LogScale& bytes,
                 const LogScale& times) {
  Point last{kLeft, kBottom};
  for (const CompareRun& run : runs) {
    if (run.ms.median <= 0.0) continue;
    const double x = run.bytes_total == 0 ? kNothingSent : bytes.at(static_cast<double>(run.bytes_total) / 1e6);
    last = {x, times.at(run.ms.median)};
    draw_mark(drawing, look(index), last);
    // On either side in turns: strategies often send the same.
    const bool right = index % 2 == 0;
    drawing.text({last.x + (right ? 8 : -8), last.y + 4}, fmt::format("{}", run.ranks),
                 right ? Anchor::Start : Anchor::End, 11);
  }
  return last;
}

std::string fastest_text(const std::vector<CompareRun>& runs) {
  const auto& best = *std::ranges::min_element(runs, {}, [](const CompareRun& run) { return run.ms.median; });
  return fmt::format("The fastest run is {} on {} ranks with {:.3g} ms; the table has all figures.", best.strategy,
                     best.ranks, best.ms.median);
}

}  // namespace

std::string plot_time_over_ranks(const std::vector<CompareRun>& runs) {
  SvgDrawing drawing(kWidth, kHeight, "Median time of a frame over the number of ranks, per strategy",
                     fastest_text(runs));
  std::set<int> counts;
  for (const CompareRun& run : runs) counts.insert(run.ranks);
  const LogScale ranks = LogScale::of({counts.begin(), counts.end()}, kLeft + 30, kRight - 30);
  const LogScale times = LogScale::of(times_of(runs), kBottom, kTop);
  draw_time_axis(drawing, times);
  double free = 0.0;
  for (const int count : counts) {
    drawing.line({ranks.at(count), kTop}, {ranks.at(count), kBottom}, kGridStroke);
    if (ranks.at(count) < free) continue;
    drawing.text({ranks.at(count), kBottom + 18}, fmt::format("{}", count), Anchor::Middle);
    free = ranks.at(count) + 22;
  }
  drawing.text({(kLeft + kRight) / 2, kBottom + 42}, "ranks", Anchor::Middle, 13);

  const auto names = strategies_of(runs);
  std::vector<Label> labels;
  for (std::size_t i = 0; i < names.size(); ++i) {
    // Strategies stand side by side, so that whiskers do not cover each other.
    const double aside = (static_cast<double>(i) - static_cast<double>(names.size() - 1) / 2.0) * 5.0;
    const Point last = draw_strategy(drawing, runs_of(runs, names[i]), look(i), ranks, times, aside);
    labels.push_back({last, i, names[i]});
  }
  draw_labels(drawing, std::move(labels), true);
  return drawing.str();
}

std::string plot_time_against_bytes(const std::vector<CompareRun>& all_runs) {
  SvgDrawing drawing(kWidth, kHeight, "Median time of a frame against the bytes all ranks send for it",
                     fastest_text(all_runs));
  std::vector<CompareRun> runs;  // a single rank has nobody to send to
  std::ranges::copy_if(all_runs, std::back_inserter(runs), [](const CompareRun& run) { return run.ranks > 1; });
  std::vector<double> megabytes;
  for (const CompareRun& run : runs) {
    if (run.bytes_total > 0) megabytes.push_back(static_cast<double>(run.bytes_total) / 1e6);
  }
  const bool some_send_nothing = megabytes.size() < runs.size();
  if (megabytes.empty()) megabytes.push_back(1.0);
  const LogScale bytes =
      LogScale::of(std::move(megabytes), some_send_nothing ? kNothingSent + 60 : kLeft + 20, kRight - 20);
  const LogScale times = LogScale::of(times_of(runs), kBottom, kTop);
  draw_time_axis(drawing, times);
  draw_bytes_axis(drawing, bytes, some_send_nothing);

  const auto names = strategies_of(all_runs);
  std::vector<Label> labels;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto own = runs_of(runs, names[i]);
    if (own.empty()) continue;
    const Point last = draw_marks(drawing, own, i, bytes, times);
    labels.push_back({last, i, names[i]});
  }
  draw_labels(drawing, std::move(labels), false);
  return drawing.str();
}

}  // namespace hpr
