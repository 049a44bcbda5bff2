#include "tools/compare/distributions/distribution_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <span>
#include <utility>

#include "tools/report/canvas.h"
#include "tools/report/plot.h"

namespace hpr {
namespace {

using Run = DistributionRun;

std::uint64_t median_of(const std::vector<std::uint64_t>& counts) {
  return static_cast<std::uint64_t>(std::llround(median({counts.begin(), counts.end()})));
}

std::uint64_t max_memory(const Run& run) {
  return std::ranges::max(run.memory_peak_bytes);
}

/// "auto (hybrid)"
std::string name_of(const Run& run) {
  return run.chosen.empty() ? run.distribution : fmt::format("{} ({})", run.distribution, run.chosen);
}

ColumnStyle ms_style(std::string title) {
  return {.title = std::move(title), .format = "{:.2f}", .csv_format = "{:.6f}", .width = 8};
}

ColumnStyle megabytes_style(std::string title, std::string html_title = {}) {
  return {
      .title = std::move(title), .html_title = std::move(html_title), .format = "{:.2f}", .scale = 1e-6, .width = 7};
}

Column<Run> spread_column(std::string key, double Spread::*member, ColumnStyle style) {
  return {std::move(key), [member](const Run& run) { return Json(spread_of(run.ms).*member); }, std::move(style)};
}

Column<Run> median_column(std::string key, std::vector<double> Run::*member, ColumnStyle style) {
  return {std::move(key), [member](const Run& run) { return Json(median(run.*member)); }, std::move(style)};
}

Column<Run> count_column(std::string key, std::vector<std::uint64_t> Run::*member, ColumnStyle style) {
  return {std::move(key), [member](const Run& run) { return Json(median_of(run.*member)); }, std::move(style)};
}

const std::vector<Column<Run>>& columns() {
  static const std::vector<Column<Run>> all{
      field<Run>("distribution", &Run::distribution),
      {"name",
       [](const Run& run) { return Json(name_of(run)); },
       {.title = "distribution", .align = Align::Left, .width = 13, .in_json = false}},
      {"chosen", [](const Run& run) { return run.chosen.empty() ? Json() : Json(run.chosen); }, {.sparse = true}},
      field<Run>("strategy", &Run::strategy, {.title = "strategy", .align = Align::Left, .gap = 2}),
      field<Run>("ranks", &Run::ranks, {.title = "ranks", .width = 5}),
      field<Run>("threads", &Run::threads, {.title = "threads"}),
      field<Run>("transport", &Run::transport),
      {"frames", [](const Run& run) { return Json(run.ms.size()); }},
      spread_column("ms.min", &Spread::min, ms_style("min")),
      spread_column(
          "ms.median", &Spread::median,
          {.title = "median ms", .html_title = "median", .format = "{:.2f}", .csv_format = "{:.6f}", .width = 9}),
      spread_column("ms.p95", &Spread::p95, ms_style("p95")),
      spread_column("ms.max", &Spread::max, ms_style("max")),
      median_column("ms_draw.median", &Run::draw_ms, ms_style("draw")),
      median_column("ms_exchange.median", &Run::exchange_ms, ms_style("exchange")),
      median_column("ms_composite.median", &Run::composite_ms, ms_style("composite")),
      median_column("ms_light.median", &Run::light_ms, ms_style("light")),
      median_column("ms_collect.median", &Run::collect_ms, ms_style("collect")),
      count_column("bytes_total", &Run::bytes_total, megabytes_style("MB sent")),
      count_column("bytes_max_rank", &Run::bytes_max_rank, megabytes_style("busiest", "MB of busiest rank")),
      count_column("messages_total", &Run::messages_total, {.title = "messages", .width = 8}),
      median_column("imbalance", &Run::imbalance,
                    {.title = "imbalance", .format = "{:.2f}", .csv_format = "{:.4f}", .width = 9}),
      field<Run>("memory_peak_bytes_per_rank", &Run::memory_peak_bytes),
      {"memory_max",
       [](const Run& run) { return Json(max_memory(run)); },
       {.title = "peak MB",
        .html_title = "peak MB of the largest rank",
        .format = "{:.1f}",
        .csv_name = "memory_peak_bytes_max_rank",
        .scale = 1e-6,
        .width = 8,
        .in_json = false}},
      field<Run>("memory_of", &Run::memory_of, {.html_title = "of a"}),
      field<Run>("differing_pixels", &Run::differing_pixels,
                 {.title = "differing",
                  .html_title = "differing pixels",
                  .width = 9,
                  .wrong = [](const Json& pixels) { return pixels.get<std::uint64_t>() > 0; }}),
      field<Run>("frame_xxh64", &Run::frame_xxh64,
                 {.title = "frame", .html_title = "frame xxh64", .align = Align::Left, .gap = 2, .code = true}),
      field<Run>("picture_xxh64", &Run::picture_xxh64, {.html_title = "picture xxh64", .code = true}),
      field<Run>("predicted_ms", &Run::predicted_ms, ms_style("predicted"))};
  return all;
}

Table table_of(const DistributionReport& report) {
  return {columns(), std::span(report.runs)};
}

/// Whose memory a peak is, where that is not the rank's alone.
std::string memory_note(const DistributionReport& report) {
  const std::string& of = report.runs.front().memory_of;
  if (of == kMemoryOfProcess) return "Peaks of memory are those of the one process whose threads all ranks are.";
  if (of == kMemoryOfJob) {
    return "Peaks of memory include what distributions before took: this system does not let a process begin anew.";
  }
  return "";
}

/// Per number of ranks the run with the best median.
std::map<int, const Run*> fastest_runs(const DistributionReport& report) {
  std::map<int, const Run*> best;
  for (const Run& run : report.runs) {
    const Run*& known = best[run.ranks];
    if (known == nullptr || median(run.ms) < median(known->ms)) known = &run;
  }
  return best;
}

std::string summary(const DistributionReport& report) {
  std::string text = "<ul>\n";
  for (const auto& [ranks, run] : fastest_runs(report)) {
    text += fmt::format("<li>On {} rank{} <strong>{}</strong> is the fastest: {:.2f} ms.</li>\n", ranks,
                        ranks == 1 ? "" : "s", escape_markup(name_of(*run)), median(run->ms));
  }
  const auto wrong = std::ranges::count_if(report.runs, [](const Run& run) { return run.differing_pixels > 0; });
  text += wrong == 0 ? "<li>Every frame of every run is right, key by key and pixel by pixel.</li>\n"
                     : fmt::format("<li><strong>{} {} from the reference.</strong></li>\n", wrong,
                                   wrong == 1 ? "run differs" : "runs differ");
  if (const std::string note = memory_note(report); !note.empty()) text += fmt::format("<li>{}</li>\n", note);
  return text + "</ul>\n";
}

/// A stage of a frame as bars show it: light enough for names in black, colors of Tol's "light" scheme.
struct Stage {
  std::string_view name;
  std::vector<double> Run::*ms;
  std::string_view color;
};
constexpr std::array<Stage, 4> kStages{{{"draw", &Run::draw_ms, "#77AADD"},
                                        {"composite", &Run::composite_ms, "#EE8866"},
                                        {"light", &Run::light_ms, "#EEDD88"},
                                        {"exchange", &Run::exchange_ms, "#99DDFF"}}};
constexpr std::string_view kRestColor = "#DDDDDD";
constexpr Stroke kOutline{"#555555", 0.6};
constexpr double kBarPitch = 24.0;
constexpr double kBarHeight = 15.0;
constexpr double kGroupGap = 14.0;

/// About as wide as a text of this size is.
double text_width(std::string_view text, double size) {
  return 0.6 * size * static_cast<double>(text.size());
}

/// Bars below each other, one for each run, from 0 to the right.
class BarPlot {
 public:
  BarPlot(const DistributionReport& report, double largest, std::string_view title, std::string_view description)
      : runs_(report.runs), layout_(layout_of(report.runs)), largest_(largest), plot_(layout_, title, description) {
    std::vector<Tick> ticks;
    const double step = step_of(largest);
    for (int i = 0; i * step <= largest * 1.0001; ++i) ticks.push_back({x_of(i * step), fmt::format("{:g}", i * step)});
    plot_.draw_x_ticks(ticks);
    plot_.draw_axis_lines();
  }

  /// Draws the names of all runs beside their bars, and calls `draw_bar(run, top)` for each.
  void draw(const std::function<void(const Run&, double)>& draw_bar) {
    double top = layout_.top + kGroupGap / 2;
    for (std::size_t i = 0; i < runs_.size(); ++i) {
      const Run& run = runs_[i];
      const bool starts_group = i == 0 || run.ranks != runs_[i - 1].ranks;
      if (starts_group && i > 0) top += kGroupGap;
      if (starts_group) {
        canvas().text({8, top + kBarHeight - 3}, fmt::format("{} rank{}", run.ranks, run.ranks == 1 ? "" : "s"),
                      Anchor::Start, 12, true);
      }
      canvas().text({layout_.left - 8, top + kBarHeight - 3}, name_of(run), Anchor::End);
      draw_bar(run, top);
      top += kBarPitch;
    }
  }

  /// A part of a bar, with its name where there is room; returns where it ends.
  double part(double from, double value, double top, std::string_view color, std::string_view name) {
    const double left = x_of(from);
    const double right = x_of(from + value);
    canvas().rectangle({left, top}, right - left, kBarHeight, color, kOutline);
    if (text_width(name, 11) + 4 < right - left) {
      canvas().text({(left + right) / 2, top + kBarHeight - 4}, name, Anchor::Middle, 11);
    }
    return from + value;
  }

  [[nodiscard]] SvgCanvas& canvas() { return plot_.canvas(); }
  [[nodiscard]] const PlotLayout& layout() const { return layout_; }
  [[nodiscard]] double x_of(double value) const {
    return layout_.left + (layout_.right - layout_.left) * value / largest_;
  }
  void name_x_axis(std::string_view name) { plot_.name_x_axis(name); }
  [[nodiscard]] std::string str() const { return plot_.str(); }

 private:
  static PlotLayout layout_of(const std::vector<Run>& runs) {
    double groups = 0.0;
    double widest = 0.0;
    for (std::size_t i = 0; i < runs.size(); ++i) {
      if (i == 0 || runs[i].ranks != runs[i - 1].ranks) groups += 1.0;
      widest = std::max(widest, text_width(name_of(runs[i]), 12));
    }
    PlotLayout layout{.left = 100.0 + widest, .right = 860.0, .top = 34.0};
    layout.bottom = layout.top + kBarPitch * static_cast<double>(runs.size()) + kGroupGap * groups;
    layout.height = layout.bottom + 60.0;
    return layout;
  }

  /// A round one, so that there are at most ten.
  static double step_of(double largest) {
    const double power = std::pow(10.0, std::floor(std::log10(largest / 10.0)));
    for (const double digit : {1.0, 2.0, 5.0}) {
      if (digit * power * 10.0 >= largest) return digit * power;
    }
    return 10.0 * power;
  }

  const std::vector<Run>& runs_;
  PlotLayout layout_;
  double largest_;
  Plot plot_;
};

std::string describe_fastest(const DistributionReport& report) {
  const Run& best = *std::ranges::min_element(report.runs, {}, [](const Run& run) { return median(run.ms); });
  return fmt::format("The fastest run is {} on {} ranks with {:.3g} ms; the table has all figures.", name_of(best),
                     best.ranks, median(best.ms));
}

void draw_legend(BarPlot& plot, bool has_predictions) {
  double x = plot.layout().left;
  constexpr double kY = 12.0;
  SvgCanvas& canvas = plot.canvas();
  const auto name = [&](std::string_view text) {
    canvas.text({x, kY + 4}, text);
    x += text_width(text, 12) + 16;
  };
  const auto box = [&](std::string_view color, std::string_view text) {
    canvas.rectangle({x, kY - 6}, 14, 12, color, kOutline);
    x += 19;
    name(text);
  };
  for (const Stage& stage : kStages) box(stage.color, stage.name);
  box(kRestColor, "rest");
  canvas.line({x + 4, kY - 7}, {x + 4, kY + 7}, {"#000000", 2.4});
  x += 12;
  name("median");
  if (!has_predictions) return;
  canvas.circle({x + 5, kY}, 4.6, "#ffffff", {"#882255", 1.8});
  x += 14;
  name("predicted");
}

}  // namespace

bool DistributionReport::oversubscribed() const {
  return std::ranges::any_of(runs, [&](const Run& run) { return run.ranks > machine.cores; });
}

bool DistributionReport::frames_agree() const {
  return std::ranges::all_of(runs, [](const Run& run) { return run.differing_pixels == 0; });
}

std::string distribution_table(const DistributionReport& report) {
  std::string text =
      compare_headline(report, report.oversubscribed()) +
      table_of(report).text({"name", "ranks", "ms.median", "predicted_ms", "ms.min", "ms.p95", "ms_draw.median",
                             "ms_exchange.median", "ms_composite.median", "ms_light.median", "imbalance", "bytes_total",
                             "bytes_max_rank", "messages_total", "memory_max", "differing_pixels", "frame_xxh64",
                             "strategy"});
  if (const std::string note = memory_note(report); !note.empty()) text += note + "\n";
  return text;
}

std::string distribution_json(const DistributionReport& report) {
  return compare_document(report, report.oversubscribed(), table_of(report).json());
}

std::string distribution_csv(const DistributionReport& report) {
  return table_of(report).csv({"distribution",
                               "chosen",
                               "strategy",
                               "ranks",
                               "threads",
                               "transport",
                               "frames",
                               "ms.min",
                               "ms.median",
                               "ms.p95",
                               "ms.max",
                               "ms_draw.median",
                               "ms_exchange.median",
                               "ms_composite.median",
                               "ms_light.median",
                               "ms_collect.median",
                               "bytes_total",
                               "bytes_max_rank",
                               "messages_total",
                               "imbalance",
                               "memory_max",
                               "memory_of",
                               "differing_pixels",
                               "frame_xxh64",
                               "picture_xxh64",
                               "predicted_ms"});
}

std::string plot_stages(const DistributionReport& report) {
  // One disturbed frame must not make all bars short.
  constexpr double kMaxWhisker = 1.5;
  double slowest = 0.0;
  double largest = 0.0;
  for (const Run& run : report.runs) {
    slowest = std::max({slowest, median(run.ms), run.predicted_ms.value_or(0.0)});
    largest = std::max(largest, spread_of(run.ms).p95);
  }
  largest = std::clamp(largest, slowest, kMaxWhisker * slowest);
  if (largest <= 0.0) largest = 1.0;
  BarPlot plot(report, largest, "What a frame is spent on, per distribution and number of ranks",
               describe_fastest(report));
  draw_legend(plot, std::ranges::any_of(report.runs, [](const Run& run) { return run.predicted_ms.has_value(); }));
  plot.name_x_axis("ms of a frame, slowest rank");
  plot.draw([&](const Run& run, double top) {
    const Spread ms = spread_of(run.ms);
    double done = 0.0;
    for (const Stage& stage : kStages) done = plot.part(done, median(run.*stage.ms), top, stage.color, stage.name);
    if (done < ms.median) plot.part(done, ms.median - done, top, kRestColor, "rest");
    SvgCanvas& canvas = plot.canvas();
    const double below = top + kBarHeight + 4;
    canvas.line({plot.x_of(ms.min), below}, {plot.x_of(std::min(ms.p95, largest)), below}, {"#000000", 1.0});
    for (const double end : {ms.min, ms.p95}) {
      if (end > largest) continue;
      canvas.line({plot.x_of(end), below - 3}, {plot.x_of(end), below + 3}, {"#000000", 1.0});
    }
    canvas.line({plot.x_of(ms.median), top - 2}, {plot.x_of(ms.median), below}, {"#000000", 2.4});
    canvas.text({plot.layout().right + 8, top + kBarHeight - 3}, fmt::format("{:.4g} ms", ms.median));
    const double center_y = top + kBarHeight / 2;
    if (run.predicted_ms) canvas.circle({plot.x_of(*run.predicted_ms), center_y}, 4.6, "#ffffff", {"#882255", 1.8});
  });
  return plot.str();
}

std::string plot_memory(const DistributionReport& report) {
  double largest = 1.0;
  for (const Run& run : report.runs) largest = std::max(largest, 1e-6 * static_cast<double>(max_memory(run)));
  BarPlot plot(report, 1.08 * largest, "Peak memory of the largest rank, per distribution and number of ranks",
               "The table has all figures.");
  plot.name_x_axis("peak memory of the largest rank, MB");
  plot.draw([&](const Run& run, double top) {
    const double megabytes = 1e-6 * static_cast<double>(max_memory(run));
    plot.part(0.0, megabytes, top, "#BBCC33", fmt::format("{:.0f} MB", megabytes));
  });
  return plot.str();
}

std::string distribution_html(const DistributionReport& report) {
  const Run& first = report.runs.front();
  std::string page = compare_heading(
      "Distributions compared", report, report.oversubscribed(),
      {Fact{"Transport", first.transport}, Fact{"Threads", fmt::format("{} a rank in the first run", first.threads)},
       Fact{"Frames", fmt::format("{} per run", first.ms.size())}});
  page += summary(report);
  page += "<h2>What a frame is spent on</h2>\n";
  page += html_figure(
      plot_stages(report),
      "Medians of the frames. A part lasts from when the last rank was done with the parts before it to "
      "when the last rank was done with it, so that waiting counts as what was waited for. Exchange is all "
      "that moves besides layers of keys that are merged: keys to the owners of tiles, light that other "
      "ranks made, tiles to screens. The rest is between samples and frames: what ranks agree on, sums, exposure. "
      "With several samples these are sums over them. Whiskers reach from the "
      "fastest frame to "
      "the 95th percentile; where one has no end on the right it goes on.");
  page += "<h2>Memory</h2>\n" + html_figure(plot_memory(report), escape_markup(memory_note(report)));
  const auto best = fastest_runs(report);
  const auto& runs = report.runs;
  page += "<h2>All runs</h2>\n" +
          table_of(report).html(
              {"name",
               "ranks",
               "threads",
               "ms.median",
               "ms.min",
               "ms.p95",
               "ms.max",
               "predicted_ms",
               "ms_draw.median",
               "ms_exchange.median",
               "ms_composite.median",
               "ms_light.median",
               "ms_collect.median",
               "imbalance",
               "bytes_total",
               "bytes_max_rank",
               "messages_total",
               "memory_max",
               "memory_of",
               "strategy",
               "differing_pixels",
               "frame_xxh64",
               "picture_xxh64"},
              {.caption =
                   "Milliseconds of a frame on the slowest rank, from its first triangle to its last tile on a screen; "
                   "collect is the part of exchange that brings tiles to screens. MB and messages are of one frame. "
                   "Imbalance: what the slowest rank computed by the mean of ranks. The fastest median of each number "
                   "of ranks is marked.",
               .highlighted = [&](std::size_t row) { return &runs[row] == best.at(runs[row].ranks); },
               .starts_group = [&](std::size_t row) { return row > 0 && runs[row].ranks != runs[row - 1].ranks; }});
  return html_page(fmt::format("hpr compare: {}", report.input), page);
}

}  // namespace hpr
