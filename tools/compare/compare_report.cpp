#include "tools/compare/compare_report.h"

#include <fmt/format.h>
#include <hpr/version.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <set>

#include "tools/report/canvas.h"
#include "tools/report/plot.h"

namespace hpr {
namespace {

constexpr PlotLayout kField;
constexpr double kNothingSent = 120.0;  ///< where runs without bytes stand
constexpr double kLabelPitch = 16.0;    ///< where there is room

enum class Mark { Circle, Square, Triangle, Diamond, Wedge };

/// How a strategy is drawn.
struct StrategyStyle {
  std::string_view color;
  Mark mark;
  std::string_view dashes;
};

StrategyStyle strategy_style(std::size_t index) {
  constexpr std::array<Mark, 5> kMarks{Mark::Circle, Mark::Square, Mark::Triangle, Mark::Diamond, Mark::Wedge};
  const SeriesStyle& series = series_style(index);
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

void draw_mark(SvgCanvas& canvas, const StrategyStyle& style, Point at, bool hollow = false) {
  constexpr double kRadius = 4.6;
  const auto fill = hollow ? std::string_view("#ffffff") : style.color;
  const Stroke stroke{style.color, hollow ? 1.6 : 0.5};
  const double left = at.x - kRadius;
  const double right = at.x + kRadius;
  const double top = at.y - kRadius;
  const double bottom = at.y + kRadius;
  switch (style.mark) {
    case Mark::Circle:
      return canvas.circle(at, kRadius, fill, stroke);
    case Mark::Square:
      return canvas.rectangle({left, top}, 2 * kRadius, 2 * kRadius, fill, stroke);
    case Mark::Triangle:
      return canvas.polygon(std::array<Point, 3>{{{left, bottom}, {right, bottom}, {at.x, top}}}, fill, stroke);
    case Mark::Wedge:
      return canvas.polygon(std::array<Point, 3>{{{left, top}, {right, top}, {at.x, bottom}}}, fill, stroke);
    case Mark::Diamond:
      return canvas.polygon(
          std::array<Point, 4>{{{left - 1, at.y}, {at.x, top - 1}, {right + 1, at.y}, {at.x, bottom + 1}}}, fill,
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

void draw_time_axis(Plot& plot, const LogScale& times) {
  plot.draw_y_ticks(times.ticks());
  plot.name_y_axis("ms of a frame, slowest rank");
  plot.draw_axis_lines();
}

/// A strategy's name to the right of the field, and the mark it belongs to.
struct Label {
  Point mark;  ///< in the field
  std::size_t series = 0;
  std::string name;
};

/// Names as near to the heights of their marks as they can stand without touching.
void draw_labels(SvgCanvas& canvas, std::vector<Label> labels, bool lead_to_marks) {
  std::ranges::stable_sort(labels, {}, [](const Label& label) { return label.mark.y; });
  const double pitch = std::min(kLabelPitch, (kField.bottom - kField.top) / static_cast<double>(labels.size()));
  std::vector<double> heights;
  double free = kField.top + 6;
  for (const Label& label : labels) {
    heights.push_back(std::max(free, label.mark.y));
    free = heights.back() + pitch;
  }
  double room = kField.bottom;
  for (std::size_t i = labels.size(); i-- > 0; room -= pitch) {
    heights[i] = std::min(heights[i], room);
    room = heights[i];
  }
  for (std::size_t i = 0; i < labels.size(); ++i) {
    const StrategyStyle style = strategy_style(labels[i].series);
    if (lead_to_marks) {
      canvas.line({labels[i].mark.x + 6, labels[i].mark.y}, {kField.right + 8, heights[i]}, {style.color, 0.6, "1 2"});
    }
    draw_mark(canvas, style, {kField.right + 16, heights[i]});
    canvas.text({kField.right + 26, heights[i] + 4}, labels[i].name);
  }
}

/// Whiskers, medians, predictions and the line through them of one strategy. Returns where it ends.
Point draw_series(SvgCanvas& canvas, const std::vector<CompareRun>& runs, const StrategyStyle& style,
                  const LogScale& ranks, const LogScale& times, double aside) {
  std::vector<Point> points;
  for (const CompareRun& run : runs) {
    if (run.ms.median > 0.0) points.push_back({ranks.at(run.ranks) + aside, times.at(run.ms.median)});
  }
  canvas.polyline(points, {style.color, 1.8, style.dashes});
  Point last{kField.left, kField.bottom};
  for (const CompareRun& run : runs) {
    const double x = ranks.at(run.ranks) + aside;
    if (run.predicted_ms.value_or(0.0) > 0.0) draw_mark(canvas, style, {x, times.at(*run.predicted_ms)}, true);
    if (run.ms.min <= 0.0) continue;
    const double top = times.at(run.ms.p95);
    const double bottom = times.at(run.ms.min);
    canvas.line({x, top}, {x, bottom}, {style.color, 1.0});
    for (const double y : {top, bottom}) canvas.line({x - 3, y}, {x + 3, y}, {style.color, 1.0});
    last = {x, times.at(run.ms.median)};
    draw_mark(canvas, style, last);
  }
  return last;
}

void draw_bytes_axis(Plot& plot, const LogScale& bytes, bool some_send_nothing) {
  plot.draw_x_ticks(bytes.ticks());
  if (some_send_nothing) {
    plot.draw_x_ticks(std::array{Tick{kNothingSent, "0"}});
    plot.canvas().line({kNothingSent + 30, kField.top}, {kNothingSent + 30, kField.bottom}, {"#444444", 1.0, "2 4"});
  }
  plot.name_x_axis("MB sent for a frame, all ranks");
}

/// The runs of strategy number `index`, each with its number of ranks. Returns where the last one stands.
Point draw_marks(SvgCanvas& canvas, const std::vector<CompareRun>& runs, std::size_t index, const LogScale& bytes,
                 const LogScale& times) {
  Point last{kField.left, kField.bottom};
  for (const CompareRun& run : runs) {
    if (run.ms.median <= 0.0) continue;
    const double x = run.bytes_total == 0 ? kNothingSent : bytes.at(static_cast<double>(run.bytes_total) / 1e6);
    last = {x, times.at(run.ms.median)};
    draw_mark(canvas, strategy_style(index), last);
    // On either side in turns: strategies often send the same.
    const bool right = index % 2 == 0;
    canvas.text({last.x + (right ? 8 : -8), last.y + 4}, fmt::format("{}", run.ranks),
                right ? Anchor::Start : Anchor::End, 11);
  }
  return last;
}

std::string describe_fastest(const std::vector<CompareRun>& runs) {
  const auto& best = *std::ranges::min_element(runs, {}, [](const CompareRun& run) { return run.ms.median; });
  return fmt::format("The fastest run is {} on {} ranks with {:.3g} ms; the table has all figures.", best.strategy,
                     best.ranks, best.ms.median);
}

/// Per number of ranks the best median.
std::map<int, double> fastest_medians(const std::vector<CompareRun>& runs) {
  std::map<int, double> best;
  for (const CompareRun& run : runs) {
    const auto [found, is_new] = best.try_emplace(run.ranks, run.ms.median);
    if (!is_new) found->second = std::min(found->second, run.ms.median);
  }
  return best;
}

std::string summary(const CompareReport& report) {
  std::string text = "<ul>\n";
  for (const auto& [ranks, ms] : fastest_medians(report.runs)) {
    const auto& run = *std::ranges::find_if(report.runs, [&, ranks = ranks, ms = ms](const CompareRun& r) {
      return r.ranks == ranks && r.ms.median == ms;
    });
    text += fmt::format("<li>On {} rank{} <strong>{}</strong> is the fastest: {:.3f} ms.</li>\n", ranks,
                        ranks == 1 ? "" : "s", escape_markup(run.strategy), ms);
  }
  const auto wrong = std::ranges::count_if(report.runs, [](const CompareRun& run) { return run.differing_pixels > 0; });
  const char* const right =
      report.operation == "nearest" ? "is right, key by key" : "is as near the serial result as rounding allows";
  text += wrong == 0 ? fmt::format("<li>Every frame of every run {}.</li>\n</ul>\n", right)
                     : fmt::format("<li><strong>{} {} from the serial composite.</strong></li>\n</ul>\n", wrong,
                                   wrong == 1 ? "run differs" : "runs differ");
  return text;
}

std::string heading(const CompareReport& report) {
  const CompareRun& first = report.runs.front();
  return compare_heading("Compositing strategies compared", report, report.oversubscribed(),
                         {Fact{"Operator", report.operation}, Fact{"Transport", first.transport},
                          Fact{"Frames", fmt::format("{} per run", first.frames)}});
}

std::string html_table(const CompareReport& report) {
  const auto best = fastest_medians(report.runs);
  const auto& runs = report.runs;
  return Table(compare_columns(), std::span(runs))
      .html(
          {"name", "ranks", "ms.median", "ms.min", "ms.p95", "ms.max", "ms_composite.median", "ms_collect.median",
           "predicted_ms", "bytes_total", "bytes_max_rank", "messages_total", "imbalance", "differing_pixels",
           "frame_xxh64"},
          {.caption =
               "Milliseconds of a frame on the slowest rank, compositing and collecting it on rank 0; MB and messages "
               "are of one frame. Imbalance: slowest rank by mean of ranks. The fastest median of each number of "
               "ranks is marked.",
           .highlighted = [&](std::size_t row) { return runs[row].ms.median == best.at(runs[row].ranks); },
           .starts_group = [&](std::size_t row) { return row > 0 && runs[row].ranks != runs[row - 1].ranks; }});
}

std::string schedules(const std::vector<StrategyDrawing>& drawings) {
  std::string text =
      "<h2>Who sends what to whom</h2>\n"
      "<p>Recorded from the strategies themselves, on threads, with a frame of 64 tiles that every rank has drawn all "
      "over. Ranks are rows, rounds are columns; what stands in one column can happen at the same time. Blue arrows "
      "carry tiles and are as wide as there are many; grey dashed ones are smaller, such as the bits that tell who has "
      "drawn where; dotted ones are empty. A bar through several ranks is a meeting in shared memory, a box what they "
      "merge in place there, whoever is free taking the next tiles.</p>\n<div class=\"schedules\">\n";
  for (const StrategyDrawing& drawing : drawings) {
    const std::string name = escape_markup(drawing.strategy);
    text += "<section>\n";
    if (drawing.svg.empty()) {
      text += fmt::format("<h3>{}</h3>\n<p>{}</p>\n", name, escape_markup(drawing.remark));
    } else {
      text +=
          fmt::format("<h3>{} on {} rank{}</h3>\n{}", name, drawing.ranks, drawing.ranks == 1 ? "" : "s", drawing.svg);
    }
    text += "</section>\n";
  }
  return text + "</div>\n";
}

}  // namespace

bool CompareReport::oversubscribed() const {
  // Simulated ranks have the cores their cluster gives them.
  return std::ranges::any_of(
      runs, [&](const CompareRun& run) { return run.transport != "simulated" && run.ranks > machine.cores; });
}

const std::vector<Column<CompareRun>>& compare_columns() {
  using Run = CompareRun;
  const auto ms = [](std::string title, std::size_t width) {
    return ColumnStyle{.title = std::move(title), .format = "{:.3f}", .csv_format = "{:.6f}", .width = width};
  };
  const auto megabytes = [](std::string title, std::string html_title) {
    return ColumnStyle{
        .title = std::move(title), .html_title = std::move(html_title), .format = "{:.2f}", .scale = 1e-6, .width = 9};
  };
  static const std::vector<Column<Run>> columns{
      field<Run>("strategy", &Run::strategy, {.title = "strategy", .align = Align::Left, .width = 13}),
      {"name",
       [](const Run& run) {
         return Json(run.chosen.empty() ? run.strategy : fmt::format("{} ({})", run.strategy, run.chosen));
       },
       {.title = "strategy", .in_json = false}},
      field<Run>("ranks", &Run::ranks, {.title = "ranks", .width = 5}),
      field<Run>("transport", &Run::transport),
      field<Run>("frames", &Run::frames),
      field<Run>(
          "ms.min", [](auto& run) -> auto& { return run.ms.min; }, ms("min", 8)),
      field<Run>(
          "ms.median", [](auto& run) -> auto& { return run.ms.median; },
          {.title = "median ms", .html_title = "median", .format = "{:.3f}", .csv_format = "{:.6f}", .width = 9}),
      field<Run>(
          "ms.p95", [](auto& run) -> auto& { return run.ms.p95; }, ms("p95", 8)),
      field<Run>(
          "ms.max", [](auto& run) -> auto& { return run.ms.max; }, ms("max", 8)),
      field<Run>("ms_composite.median", &Run::ms_composite, ms("composite", 9)),
      field<Run>("ms_collect.median", &Run::ms_collect, ms("collect", 8)),
      field<Run>("bytes_total", &Run::bytes_total, megabytes("MB sent", "")),
      field<Run>("bytes_max_rank", &Run::bytes_max_rank, megabytes("", "MB of busiest rank")),
      field<Run>("messages_total", &Run::messages_total, {.title = "messages", .width = 8}),
      field<Run>("imbalance", &Run::imbalance,
                 {.title = "imbalance", .format = "{:.2f}", .csv_format = "{:.4f}", .width = 9}),
      field<Run>("differing_pixels", &Run::differing_pixels,
                 {.title = "differing",
                  .html_title = "differing pixels",
                  .width = 9,
                  .wrong = [](const Json& pixels) { return pixels.get<std::uint64_t>() > 0; }}),
      field<Run>("frame_xxh64", &Run::frame_xxh64,
                 {.title = "frame", .html_title = "frame xxh64", .align = Align::Left, .gap = 2, .code = true}),
      field<Run>("predicted_ms", &Run::predicted_ms, ms("predicted", 9)),
      field<Run>("max_error", &Run::max_error, {.csv_format = "{:.6g}", .sparse = true}),
      {"max_error_note",
       [](const Run& run) { return Json(run.max_error ? fmt::format("max error {:.3g}", *run.max_error) : ""); },
       {.align = Align::Left, .gap = 2, .in_json = false}},
      {"chosen",
       [](const Run& run) { return run.chosen.empty() ? Json() : Json(run.chosen); },
       {.sparse = true},
       [](Run& run, const Json& value) { run.chosen = value.string(); }}};
  return columns;
}

std::string compare_headline(const CompareSubject& subject, bool oversubscribed) {
  return fmt::format("{}, {} screen{} of {}x{}, seed {}; {}, {} cores{}, {}\n", subject.input, grid_name(subject.grid),
                     subject.grid.area() == 1 ? "" : "s", subject.screen.width, subject.screen.height, subject.seed,
                     subject.machine.cpu, subject.machine.cores, oversubscribed ? " (fewer than ranks)" : "",
                     subject.machine.mpi);
}

std::string compare_document(const CompareSubject& subject, bool oversubscribed, Json runs) {
  Json machine = machine_json(subject.machine);
  machine["oversubscribed"] = oversubscribed;
  const Json json{
      {"schema", "hpr.compare/1"},
      {"command", subject.command},
      {"commit", std::string(kCommit)},
      {"machine", machine},
      {"image",
       {{"width", subject.screen.width}, {"height", subject.screen.height}, {"tiles", grid_name(subject.grid)}}},
      {"input", subject.input},
      {"operator", subject.operation},
      {"seed", subject.seed},
      {"runs", std::move(runs)}};
  return json.dump(2) + "\n";
}

std::string compare_heading(std::string_view title, const CompareSubject& subject, bool oversubscribed,
                            std::vector<Fact> further) {
  const std::string screens =
      subject.grid.area() == 1 ? "one screen" : fmt::format("{} screens", grid_name(subject.grid));
  std::vector<Fact> facts{
      {"Input", fmt::format("{}, seed {}", subject.input, subject.seed)},
      {"Wall", fmt::format("{} of {}x{} pixels", screens, subject.screen.width, subject.screen.height)},
      {"Machine", subject.machine.cpu},
      {"Cores", fmt::format("{}, {}oversubscribed", subject.machine.cores, oversubscribed ? "" : "not ")},
      {"MPI", subject.machine.mpi}};
  std::ranges::move(further, std::back_inserter(facts));
  facts.push_back({"Commit", std::string(kCommit)});
  facts.push_back({"Command", subject.command, true});
  std::string text = html_heading(title, facts);
  if (oversubscribed) {
    text +=
        "<p class=\"warning\">Some runs have more ranks than cores: their times say how the cores were shared as much "
        "as what a frame costs.</p>\n";
  }
  return text;
}

std::string compare_table(const CompareReport& report) {
  return compare_headline(report, report.oversubscribed()) +
         Table(compare_columns(), std::span(report.runs))
             .text({"strategy", "ranks", "ms.median", "predicted_ms", "ms.min", "ms.p95", "ms.max",
                    "ms_composite.median", "ms_collect.median", "bytes_total", "messages_total", "imbalance",
                    "differing_pixels", "frame_xxh64", "max_error_note"});
}

std::string compare_json(const CompareReport& report) {
  return compare_document(report, report.oversubscribed(), Table(compare_columns(), std::span(report.runs)).json());
}

std::string compare_csv(const CompareReport& report) {
  return Table(compare_columns(), std::span(report.runs)).csv();
}

std::string plot_time_over_ranks(const std::vector<CompareRun>& runs) {
  Plot plot(kField, "Median time of a frame over the number of ranks, per strategy", describe_fastest(runs));
  std::set<int> counts;
  for (const CompareRun& run : runs) counts.insert(run.ranks);
  const LogScale ranks = LogScale::of({counts.begin(), counts.end()}, kField.left + 30, kField.right - 30);
  const LogScale times = LogScale::of(times_of(runs), kField.bottom, kField.top);
  draw_time_axis(plot, times);
  double free = 0.0;
  std::vector<Tick> ticks;
  for (const int count : counts) {
    const double x = ranks.at(count);
    const bool fits = x >= free;
    ticks.push_back({x, fits ? fmt::format("{}", count) : ""});
    if (fits) free = x + 22;
  }
  plot.draw_x_ticks(ticks);
  plot.name_x_axis("ranks");

  const auto names = strategies_of(runs);
  std::vector<Label> labels;
  for (std::size_t i = 0; i < names.size(); ++i) {
    // Strategies stand side by side, so that whiskers do not cover each other.
    const double aside = (static_cast<double>(i) - static_cast<double>(names.size() - 1) / 2.0) * 5.0;
    const Point last = draw_series(plot.canvas(), runs_of(runs, names[i]), strategy_style(i), ranks, times, aside);
    labels.push_back({last, i, names[i]});
  }
  draw_labels(plot.canvas(), std::move(labels), true);
  return plot.str();
}

std::string plot_time_against_bytes(const std::vector<CompareRun>& all_runs) {
  Plot plot(kField, "Median time of a frame against the bytes all ranks send for it", describe_fastest(all_runs));
  std::vector<CompareRun> runs;  // a single rank has nobody to send to
  std::ranges::copy_if(all_runs, std::back_inserter(runs), [](const CompareRun& run) { return run.ranks > 1; });
  std::vector<double> megabytes;
  for (const CompareRun& run : runs) {
    if (run.bytes_total > 0) megabytes.push_back(static_cast<double>(run.bytes_total) / 1e6);
  }
  const bool some_send_nothing = megabytes.size() < runs.size();
  if (megabytes.empty()) megabytes.push_back(1.0);
  const LogScale bytes =
      LogScale::of(std::move(megabytes), some_send_nothing ? kNothingSent + 60 : kField.left + 20, kField.right - 20);
  const LogScale times = LogScale::of(times_of(runs), kField.bottom, kField.top);
  draw_time_axis(plot, times);
  draw_bytes_axis(plot, bytes, some_send_nothing);

  const auto names = strategies_of(all_runs);
  std::vector<Label> labels;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto own = runs_of(runs, names[i]);
    if (own.empty()) continue;
    const Point last = draw_marks(plot.canvas(), own, i, bytes, times);
    labels.push_back({last, i, names[i]});
  }
  draw_labels(plot.canvas(), std::move(labels), false);
  return plot.str();
}

std::string compare_html(const CompareReport& report, const std::vector<StrategyDrawing>& drawings) {
  std::string page = heading(report) + summary(report);
  page += "<h2>Time over ranks</h2>\n";
  page += html_figure(plot_time_over_ranks(report.runs),
                      "Median of the frames; whiskers reach from the fastest frame to the 95th percentile. Hollow "
                      "marks, where there are any, are what the cost model predicts.");
  page += "<h2>Time against bytes</h2>\n";
  page += html_figure(plot_time_against_bytes(report.runs),
                      "The numbers beside the marks are ranks. What ranks read of each other's memory is not sent. "
                      "Runs on one rank are left out.");
  page += "<h2>All runs</h2>\n" + html_table(report);
  page += schedules(drawings);
  return html_page(fmt::format("hpr compare: {}", report.input), page);
}

}  // namespace hpr
