#include "tools/tradeoff/tradeoff_report.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <hpr/version.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <iterator>
#include <map>
#include <span>
#include <string_view>

#include "core/error.h"
#include "core/json.h"
#include "core/text.h"
#include "rt/passes/pass_list.h"
#include "tools/report/canvas.h"
#include "tools/report/plot.h"
#include "tools/report/table.h"
#include "tools/sweep.h"

namespace hpr {
namespace {

/// A number where the text is one, else the text.
Json knob_value(const std::string& text) {
  double value = 0.0;
  const auto [stopped, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc() && stopped == text.data() + text.size() && std::isfinite(value)) {
    std::int64_t whole = 0;
    const auto as_whole = std::from_chars(text.data(), text.data() + text.size(), whole);
    if (as_whole.ec == std::errc() && as_whole.ptr == text.data() + text.size()) return whole;
    return value;
  }
  return text;
}

Json knobs_json(const KnobValues& knobs) {
  Json json = Json::object();
  for (const auto& [knob, value] : knobs) json[knob] = knob_value(value);
  return json;
}

std::string metric_text(const std::string& metric, const PictureError& error) {
  const double value = error.of(metric);
  if (std::isnan(value)) return "-";
  return metric == "psnr" ? fmt::format("{:.2f}", value) : fmt::format("{:.4g}", value);
}

/// The signed error of the mean, in per cent of the reference's.
std::string mean_text(const TradeoffReference& reference, const TradeoffPoint& point) {
  if (!(reference.mean > 0.0)) return "-";
  const double percent = 100.0 / reference.mean;
  std::string mean = fmt::format("{:+.2f}", percent * point.error.mean);
  if (!std::isfinite(point.error.mean_error)) return mean;
  return fmt::format("{} +- {:.2f}", mean, percent * point.error.mean_error);
}

/// The columns of points that JSON has, which a file of points has too. `width`: of the pictures.
std::vector<Column<TradeoffPoint>> data_columns(std::size_t width) {
  using Row = TradeoffPoint;
  const auto metric = [](const char* name, double PictureError::*member, std::string format = "{:.4g}") {
    return field<Row>(std::string("error.") + name, [member](auto& row) -> auto& { return row.error.*member; },
                      {.title = name, .format = std::move(format), .csv_name = name});
  };
  return {{"knobs", [](const Row& row) { return knobs_json(row.knobs); }},
          {"ms.median",
           [](const Row& row) { return Json(row.median_ms()); },
           {.title = "ms", .format = "{:.1f}", .csv_name = "ms"}},
          {"ms.min", [](const Row& row) { return Json(std::ranges::min(row.ms)); }},
          {"ms.max", [](const Row& row) { return Json(std::ranges::max(row.ms)); }},
          {"ms.frames", [](const Row& row) { return Json(row.ms.size()); }},
          metric("rmse", &PictureError::rmse),
          metric("relmse", &PictureError::relmse),
          metric("relmse_untrimmed", &PictureError::relmse_all),
          {"error.psnr",
           [](const Row& row) { return Json(row.error.psnr); },
           {.title = "psnr", .format = "{:.2f}", .csv_name = "psnr"},
           [](Row& row, const Json& value) {
             read_member(row.error.psnr, value);
             // The PSNR of equal pictures is infinite, which JSON does not have.
             if (value.is_null() && row.error.rmse == 0.0) row.error.psnr = HUGE_VAL;
           }},
          metric("ssim", &PictureError::ssim),
          metric("flip", &PictureError::flip),
          metric("mean", &PictureError::mean),
          metric("mean_error", &PictureError::mean_error),
          {"error.worst.x", [=](const Row& row) { return Json(row.error.worst_pixel % width); }},
          {"error.worst.y", [=](const Row& row) { return Json(row.error.worst_pixel / width); }},
          field<Row>("error.worst.value", [](auto& row) -> auto& { return row.error.worst; },
                     {.title = "largest difference", .format = "{:.3g}", .csv_name = "worst"}),
          {"pareto", [](const Row& row) { return Json(row.pareto); }},
          field<Row>("samples", &Row::samples),
          {"passes",
           [](const Row& row) {
             Json passes = Json::array();
             for (const PassTime& time : row.times) passes.push_back({{"name", time.name}, {"ms", time.ms}});
             return passes;
           },
           {},
           [](Row& row, const Json& value) {
             for (const Json& time : value.elements()) {
               row.times.push_back({time.at("name").string(), time.at("ms").get<double>()});
             }
           }},
          {"rays",
           [](const Row& row) {
             Json rays{{"primary", row.rays.primary}};
             for (const PassInfo& pass : all_passes()) rays[pass.name] = row.rays[pass.id];
             return rays;
           },
           {},
           [](Row& row, const Json& value) {
             row.rays.primary = value.at("primary").get<std::uint64_t>();
             for (const PassInfo& pass : all_passes()) row.rays[pass.id] = value.at(pass.name).get<std::uint64_t>();
           }},
          field<Row>(
              "not_finite", [](auto& row) -> auto& { return row.rays.not_finite; }),
          field<Row>("bytes_sent", &Row::bytes_sent)};
}

/// The columns of a file of points.
std::vector<Column<TradeoffPoint>> file_columns() {
  using Row = TradeoffPoint;
  std::vector<Column<Row>> columns = data_columns(1);
  columns.push_back({"values",
                     [](const Row& row) {
                       Json values = Json::array();
                       for (const auto& [knob, value] : row.knobs) values.push_back(Json::array({knob, value}));
                       return values;
                     },
                     {},
                     [](Row& row, const Json& values) {
                       for (const Json& value : values.elements()) {
                         row.knobs.emplace_back(value[0].string(), value[1].string());
                       }
                     }});
  columns.push_back(field<Row>("all_ms", &Row::ms));
  columns.push_back(field<Row>(
      "worst_pixel", [](auto& row) -> auto& { return row.error.worst_pixel; }));
  columns.push_back(field<Row>("crop", &Row::crop_png));
  columns.push_back(field<Row>("flip_crop", &Row::flip_png));
  return columns;
}

/// All columns of a report's points.
std::vector<Column<TradeoffPoint>> point_columns(const TradeoffReport& report) {
  using Row = TradeoffPoint;
  const auto width = std::max<std::size_t>(static_cast<std::size_t>(report.size.width), 1);
  std::vector<Column<Row>> columns = data_columns(width);
  const double percent = report.reference.mean > 0.0 ? 100.0 / report.reference.mean : std::nan("");
  const auto add = [&](std::string key, std::function<Json(const Row&)> value, ColumnStyle style) {
    style.gap = 2;
    style.in_json = false;
    columns.push_back({std::move(key), std::move(value), std::move(style)});
  };
  for (Column<Row>& column : columns) column.style.gap = 2;
  add("mark", [](const Row& row) { return Json(row.pareto ? "*" : " "); }, {});
  add("number", [&](const Row& row) { return Json(&row - report.points.data() + 1); }, {.title = "#"});
  for (std::size_t i = 0; i < report.knobs.size(); ++i) {
    const std::string& knob = report.knobs[i];
    add("knob." + knob, [i](const Row& row) { return Json(row.knobs[i].second); }, {.title = knob, .csv_name = knob});
  }
  add("mean_text", [&](const Row& row) { return Json(mean_text(report.reference, row)); }, {.title = "mean in %"});
  add("mean_percent", [=](const Row& row) { return Json(percent * row.error.mean); },
      {.title = "signed mean, %", .format = "{:.3g}"});
  add("mean_error_percent", [=](const Row& row) { return Json(percent * row.error.mean_error); },
      {.title = "its standard error", .format = "{:.3g}"});
  add("worst_at",
      [=](const Row& row) {
        return Json(fmt::format("{},{}", row.error.worst_pixel % width, row.error.worst_pixel / width));
      },
      {.title = "at"});
  return columns;
}

/// The keys of columns for people: `first`, the knobs, the time, the errors that were asked for, and `last`.
std::vector<std::string> shown_columns(const TradeoffReport& report, std::vector<std::string> first,
                                       const std::vector<std::string>& last) {
  for (const std::string& knob : report.knobs) first.push_back("knob." + knob);
  first.emplace_back("ms.median");
  for (const std::string& metric : report.metrics) first.push_back("error." + metric);
  std::ranges::copy(last, std::back_inserter(first));
  return first;
}

const std::vector<Column<KnobSlope>>& slope_columns() {
  using Row = KnobSlope;
  static const std::vector<Column<Row>> columns{
      field<Row>("knob", &Row::knob, {.title = "knob"}),
      {"at", [](const Row& row) { return knobs_json(row.others); }},
      field<Row>("metric", &Row::metric, {.title = "metric"}),
      field<Row>("slope", &Row::slope, {.title = "power", .format = "{:+.3f}"}),
      field<Row>("spread", &Row::spread, {.title = "its standard error", .format = "{:.3f}"}),
      field<Row>("points", &Row::points),
      {"others", [](const Row& row) { return Json(describe(row.others)); }, {.title = "at", .in_json = false}}};
  return columns;
}

constexpr PlotLayout kField{
    .width = 940.0, .height = 430.0, .left = 86.0, .right = 680.0, .top = 18.0, .bottom = 370.0, .y_name_at = 18.0};
constexpr Stroke kFront{"#d8c070", 6.0};

/// A point of the sweep in the plot.
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

void draw_line(SvgCanvas& canvas, const std::vector<Dot>& dots, const Stroke& stroke) {
  std::vector<Point> points;
  points.reserve(dots.size());
  for (const Dot& dot : dots) points.push_back(dot.at);
  if (dots.size() > 1) canvas.polyline(points, stroke);
}

/// Points that can be drawn have a time and an error, neither of them 0.
bool can_be_drawn(const TradeoffPoint& point, const std::string& metric) {
  const double error = badness(metric, point.error.of(metric));
  return std::isfinite(error) && error > 0.0 && point.median_ms() > 0.0;
}

/// Series `index`: a line of points, and its name where there is room.
void draw_series(SvgCanvas& canvas, const std::vector<Dot>& dots, const std::string& name, std::size_t index) {
  const SeriesStyle& style = series_style(index);
  draw_line(canvas, dots, {style.color, 1.6, style.dashes});
  for (const Dot& dot : dots) {
    canvas.circle(dot.at, 4.4, dot.pareto ? style.color : "#ffffff", {style.color, 1.5});
    canvas.text({dot.at.x + 6, dot.at.y - 5}, fmt::format("{}", dot.number), Anchor::Start, 10);
  }
  const double height = kField.top + 12 + 18.0 * static_cast<double>(index);
  if (name.empty() || height > kField.bottom) return;
  canvas.line({kField.right + 14, height - 4}, {kField.right + 40, height - 4}, {style.color, 1.6, style.dashes});
  canvas.text({kField.right + 46, height}, name);
}

/// An SVG plot of the points, numbered as the rows of the table: error by `metric` over time, both logarithmic. Points
/// that differ in the last knob alone are joined; the front is filled. Empty where no point has an error above 0.
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
  const LogScale x = LogScale::of(times, kField.left + 16, kField.right - 16);
  const LogScale y = LogScale::of(errors, kField.bottom - 8, kField.top + 8);
  Plot plot(kField, fmt::format("{} over time", axis_name(metric)),
            "Each number is a row of the table; the broad line joins what nothing else beats.");
  plot.draw_y_ticks(y.ticks());
  plot.draw_x_ticks(x.ticks());
  plot.draw_axis_lines();
  plot.name_x_axis("ms of a frame, slowest rank");
  plot.name_y_axis(axis_name(metric));

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
  if (metric == report.metrics.front()) draw_line(plot.canvas(), front, kFront);
  for (std::size_t i = 0; i < order.size(); ++i) draw_series(plot.canvas(), lines.at(order[i]), describe(order[i]), i);
  return plot.str();
}

/// An SVG plot: a bar for each point, divided by the fractions of its time that its passes take.
std::string plot_pass_times(const TradeoffReport& report) {
  constexpr double kPitch = 20.0;
  std::vector<std::string> names;
  for (const TradeoffPoint& point : report.points) {
    for (const PassTime& time : point.times) {
      if (time.ms > 0.0 && std::ranges::find(names, time.name) == names.end()) names.push_back(time.name);
    }
  }
  const double height = kField.top + kPitch * static_cast<double>(std::max(report.points.size(), names.size())) + 10;
  SvgCanvas canvas(kField.width, height, "Where the time of each point goes",
                   "Shares of the passes; times of threads are added up.");
  for (std::size_t i = 0; i < report.points.size(); ++i) {
    const TradeoffPoint& point = report.points[i];
    double sum = 0.0;
    for (const PassTime& time : point.times) sum += time.ms;
    const double top = kField.top + kPitch * static_cast<double>(i);
    canvas.text({kField.left - 8, top + 11}, fmt::format("{}: {:.1f} ms", i + 1, point.median_ms()), Anchor::End, 11);
    double left = kField.left;
    for (std::size_t name = 0; name < names.size() && sum > 0.0; ++name) {
      const auto found = std::ranges::find(point.times, names[name], &PassTime::name);
      if (found == point.times.end()) continue;
      const double width = (kField.right - kField.left) * found->ms / sum;
      canvas.rectangle({left, top}, width, kPitch - 5, series_style(name).color, {"#ffffff", 0.5});
      left += width;
    }
  }
  for (std::size_t name = 0; name < names.size(); ++name) {
    const double top = kField.top + kPitch * static_cast<double>(name);
    canvas.rectangle({kField.right + 14, top}, 14, kPitch - 7, series_style(name).color, {"#ffffff", 0.5});
    canvas.text({kField.right + 34, top + 11}, names[name]);
  }
  return canvas.str();
}

std::string heading(const TradeoffReport& report) {
  const TradeoffReference& reference = report.reference;
  std::string truth = reference.how;
  if (reference.spp > 0) truth += fmt::format(", {} samples", reference.spp);
  if (std::isfinite(reference.relmse)) truth += fmt::format(", its own relMSE about {:.2g}", reference.relmse);
  const std::string scene =
      fmt::format("{}, {}x{} pixels, seed {}", report.scene, report.size.width, report.size.height, report.seed);
  const std::string machine = fmt::format("{}, {} rank{} of {} thread{}", report.machine.cpu, report.ranks,
                                          report.ranks == 1 ? "" : "s", report.threads, report.threads == 1 ? "" : "s");
  std::string text =
      html_heading("Speed against accuracy",
                   std::array{Fact{"Scene", scene}, Fact{"Truth", truth}, Fact{"Machine", machine},
                              Fact{"Commit", std::string(kCommit)}, Fact{"Command", report.command, true}});
  if (report.budget) {
    text += fmt::format("<p><strong>{}.</strong></p>\n", escape_markup(answer(report)));
    if (report.best) {
      text += fmt::format("<p><code>{}</code></p>\n", escape_markup(command_for(report, report.points[*report.best])));
    }
  }
  return text;
}

std::string html_points(const TradeoffReport& report) {
  const std::string caption = fmt::format(
      "Median milliseconds of a frame and how far it is from the truth; rows that nothing beats in both "
      "time and {} are marked.",
      report.metrics.front());
  return Table(point_columns(report), std::span(report.points))
      .html(shown_columns(report, {"number"}, {"mean_percent", "mean_error_percent", "error.worst.value", "worst_at"}),
            {.caption = caption, .highlighted = [&](std::size_t row) { return report.points[row].pareto; }});
}

std::string html_slopes(const TradeoffReport& report) {
  std::vector<KnobSlope> slopes = knob_slopes(report.points, report.metrics);
  std::erase_if(slopes, [](const KnobSlope& slope) { return slope.points < 3; });
  if (slopes.empty()) return {};
  return "<h2>How errors go with a knob</h2>\n<p>The power of the knob an error goes with while the other knobs stand "
         "still: the slope of the line through the logarithms. Pure noise has -1 over samples by relMSE; what does not "
         "fall is bias.</p>\n" +
         Table(slope_columns(), std::span<const KnobSlope>(slopes))
             .html({"knob", "metric", "slope", "spread", "others"});
}

std::string picture(const std::string& png, const std::string& what) {
  if (png.empty()) return {};
  return fmt::format(
      "<img src=\"data:image/png;base64,{}\" alt=\"{}\" style=\"image-rendering: pixelated; width: "
      "160px\"/>\n",
      png, escape_markup(what));
}

std::string crops(const TradeoffReport& report) {
  std::string text =
      "<h2>What it looks like</h2>\n<p>The part of the picture with most detail: the truth, then each point with the "
      "map of what a viewer sees to be wrong (FLIP: black is nothing, pale yellow everything).</p>\n"
      "<div class=\"schedules\">\n<figure>\n" +
      picture(report.reference_crop_png, "the truth") + "<figcaption>the truth</figcaption>\n</figure>\n";
  for (std::size_t i = 0; i < report.points.size(); ++i) {
    const TradeoffPoint& point = report.points[i];
    text += "<figure>\n" + picture(point.crop_png, "picture of point " + std::to_string(i + 1)) +
            picture(point.flip_png, "errors of point " + std::to_string(i + 1));
    text += fmt::format("<figcaption>{}: {}, {:.1f} ms</figcaption>\n</figure>\n", i + 1,
                        escape_markup(describe(point.knobs)), point.median_ms());
  }
  return text + "</div>\n";
}

/// What a plot with a scale of logarithms cannot show.
std::string left_out(const TradeoffReport& report, const std::string& metric) {
  std::string rows;
  for (std::size_t i = 0; i < report.points.size(); ++i) {
    if (badness(metric, report.points[i].error.of(metric)) != 0.0) continue;
    rows += fmt::format("{}{}", rows.empty() ? "" : ", ", i + 1);
  }
  return rows.empty() ? "" : fmt::format(" Not drawn, as without any error: {}.", rows);
}

}  // namespace

std::string describe(const KnobValues& knobs) {
  std::string text;
  for (const auto& [knob, value] : knobs) text += fmt::format("{}{}={}", text.empty() ? "" : " ", knob, value);
  return text;
}

std::string command_for(const TradeoffReport& report, const TradeoffPoint& point) {
  std::vector<std::string> arguments{"hpr",
                                     "render",
                                     report.scene,
                                     "-o",
                                     "picture.png",
                                     "--size",
                                     fmt::format("{}x{}", report.size.width, report.size.height)};
  std::ranges::copy(report.base_options, std::back_inserter(arguments));
  for (auto [knob, value] : point.knobs) {
    std::ranges::replace(value, '+', ',');
    arguments.push_back(fmt::format("--{}={}", knob, value));
  }
  // A sweep measures plain samples, which `render` draws where their number is given.
  const auto states = [&](std::string_view start) {
    return std::ranges::any_of(arguments, [&](const std::string& argument) { return argument.starts_with(start); });
  };
  if (!states("--spp=") && !states("--quality=best")) arguments.emplace_back("--spp=1");
  return shell_line(arguments);
}

std::string answer(const TradeoffReport& report) {
  if (!report.budget) return {};
  const std::string& metric = report.budget->ms ? report.metrics.front() : report.budget->metric;
  if (report.best) {
    const TradeoffPoint& best = report.points[*report.best];
    const std::string found = fmt::format("{} ({:.1f} ms, {} {})", describe(best.knobs), best.median_ms(), metric,
                                          metric_text(metric, best.error));
    return report.budget->ms ? fmt::format("within {:g} ms the most accurate is {}", *report.budget->ms, found)
                             : fmt::format("within {} {:g} the fastest is {}", metric, report.budget->error, found);
  }
  const auto closest = std::ranges::min_element(report.points, {}, [&](const TradeoffPoint& point) {
    return report.budget->ms ? point.median_ms() : badness(metric, point.error.of(metric));
  });
  return fmt::format("no point is within the budget; the closest is {} ({:.1f} ms, {} {})", describe(closest->knobs),
                     closest->median_ms(), metric, metric_text(metric, closest->error));
}

std::string tradeoff_table(const TradeoffReport& report) {
  std::string text = fmt::format("{} at {}x{} against {}{}\n", report.scene, report.size.width, report.size.height,
                                 report.reference.how,
                                 report.reference.spp > 0 ? fmt::format(", {} samples", report.reference.spp) : "");
  text += Table(point_columns(report), std::span(report.points)).text(shown_columns(report, {"mark"}, {"mean_text"}));
  text += fmt::format("*: nothing is both faster and better by {}\n", report.metrics.front());
  for (const KnobSlope& slope : knob_slopes(report.points, std::span(report.metrics).first(1))) {
    if (slope.points < 3) continue;
    text += fmt::format("{} goes with {} to the power {:+.2f} +- {:.2f}{}\n", slope.metric, slope.knob, slope.slope,
                        slope.spread, slope.others.empty() ? "" : " at " + describe(slope.others));
  }
  if (report.budget) {
    text += answer(report) + "\n";
    if (report.best) text += "  " + command_for(report, report.points[*report.best]) + "\n";
  }
  return text;
}

std::string tradeoff_json(const TradeoffReport& report) {
  const Json points = Table(point_columns(report), std::span(report.points)).json();
  const std::vector<KnobSlope> slopes = knob_slopes(report.points, report.metrics);
  Json best;
  if (report.best) {
    best = points[*report.best];
    best["command"] = command_for(report, report.points[*report.best]);
  }
  const Json json{{"schema", "hpr.tradeoff/1"},
                  {"command", report.command},
                  {"commit", kCommit},
                  {"machine", machine_json(report.machine)},
                  {"ranks", report.ranks},
                  {"threads", report.threads},
                  {"scene", report.scene},
                  {"size", fmt::format("{}x{}", report.size.width, report.size.height)},
                  {"seed", report.seed},
                  {"reference",
                   {{"how", report.reference.how},
                    {"spp", report.reference.spp > 0 ? Json(report.reference.spp) : Json()},
                    {"estimated_relmse", report.reference.relmse},
                    {"mean", report.reference.mean},
                    {"cached", report.reference.cached}}},
                  {"knobs", report.knobs},
                  {"metrics", report.metrics},
                  {"points", points},
                  {"slopes", Table(slope_columns(), std::span(slopes)).json()},
                  {"best_under_budget", best}};
  return json.dump(2) + "\n";
}

std::string tradeoff_csv(const TradeoffReport& report) {
  std::vector<std::string> keys;
  for (const std::string& knob : report.knobs) keys.push_back("knob." + knob);
  for (const char* key :
       {"ms.median", "ms.min", "ms.max", "error.rmse", "error.relmse", "error.relmse_untrimmed", "error.psnr",
        "error.ssim", "error.flip", "error.mean", "error.mean_error", "error.worst.value", "pareto"}) {
    keys.emplace_back(key);
  }
  return Table(point_columns(report), std::span(report.points)).csv(keys);
}

std::string tradeoff_html(const TradeoffReport& report) {
  std::string body = heading(report);
  for (const std::string& metric : report.metrics) {
    const std::string svg = plot_error_over_time(report, metric);
    if (svg.empty()) continue;
    body += html_figure(svg, fmt::format("Error by {} over time; numbers are rows of the table, filled marks are those "
                                         "nothing beats by {}.{}",
                                         metric, report.metrics.front(), left_out(report, metric)));
  }
  body += "<h2>All points</h2>\n" + html_points(report) + html_slopes(report);
  body +=
      "<h2>Where the time goes</h2>\n" +
      html_figure(plot_pass_times(report), "Shares of the passes in each point's time; times of threads are added up.");
  body += crops(report);
  return html_page("hpr tradeoff", body);
}

std::string encode_points(const std::string& identity, const std::vector<TradeoffPoint>& points) {
  return Json{{"schema", "hpr.tradeoff-points/1"},
              {"sweep", identity},
              {"points", Table(file_columns(), std::span(points)).json()}}
             .dump() +
         "\n";
}

std::vector<TradeoffPoint> decode_points(const std::string& text, const std::string& name,
                                         const std::string& identity) {
  try {
    const Json json = Json::parse(text);
    if (json.at("schema") != "hpr.tradeoff-points/1" || json.at("sweep") != identity) {
      throw Error(ExitCode::BadInput, name + ": these are the points of another sweep", "leave out --resume");
    }
    std::vector<TradeoffPoint> points = rows_from_json(file_columns(), json.at("points"));
    if (std::ranges::any_of(points, [](const TradeoffPoint& point) { return point.ms.empty(); })) {
      throw Error(ExitCode::BadInput, name + ": a point without times", "leave out --resume");
    }
    return points;
  } catch (const JsonError&) {
    throw Error(ExitCode::BadInput, name + ": this is no file of a sweep's points", "leave out --resume");
  }
}

}  // namespace hpr
