#include "tools/stability/stability.h"

#include <fmt/format.h>
#include <hpr/version.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "app/doctor/doctor.h"
#include "core/error.h"
#include "core/json.h"
#include "tools/report/canvas.h"
#include "tools/report/plot.h"
#include "tools/report/table.h"

namespace hpr {

// Every case, in the order of the report. Each stands in a file of this folder, which defines NAME_case().
#define HPR_FOR_EACH_STABILITY_CASE(visit)                                                                           \
  visit(depth_order) visit(crossing_planes) visit(coplanar) visit(slivers) visit(slanted_planes) visit(offset)       \
      visit(scale) visit(nodes) visit(frusta) visit(giant) visit(tiny) visit(degenerate) visit(layers) visit(frames) \
          visit(watertight) visit(acne) visit(accumulator) visit(photons) visit(mirrors) visit(lights)               \
              visit(materials) visit(not_finite)

#define HPR_DECLARE_CASE(name) StabilityCase name##_case();
#define HPR_MAKE_CASE(name) stability::name##_case(),

namespace stability {
HPR_FOR_EACH_STABILITY_CASE(HPR_DECLARE_CASE)
}

std::span<const StabilityCase> all_stability_cases() {
  static const std::array cases{HPR_FOR_EACH_STABILITY_CASE(HPR_MAKE_CASE)};
  return cases;
}

namespace {

constexpr PlotLayout kField{.width = 720.0,
                            .height = 330.0,
                            .left = 86.0,
                            .right = 700.0,
                            .top = 18.0,
                            .bottom = 270.0,
                            .x_name_below = 40.0,
                            .y_name_at = 18.0};
constexpr Stroke kMeasured{"#332288", 1.8};
constexpr Stroke kExpected{"#117733", 1.6, "7 4"};
constexpr Stroke kLimit{"#8a3c00", 1.4};
constexpr Stroke kBreak{"#8a3c00", 1.2, "2 3"};

using Points = std::vector<std::pair<double, double>>;

/// A logarithmic axis that shows zero and infinity too, at its ends.
class Axis {
 public:
  Axis(const std::vector<double>& values, double from, double to) : scale_(1.0, 10.0, from, to) {
    std::vector<double> drawn;
    for (const double value : values) {
      has_zero_ = has_zero_ || !(value > 0.0);
      has_infinity_ = has_infinity_ || std::isinf(value);
      if (value > 0.0 && std::isfinite(value)) drawn.push_back(value);
    }
    if (drawn.empty()) drawn.push_back(1.0);
    const auto [low, high] = std::ranges::minmax(drawn);
    zero_ = low / 10.0;
    infinity_ = high * 10.0;
    if (has_zero_) drawn.push_back(zero_);
    if (has_infinity_) drawn.push_back(infinity_);
    low_ = low;
    high_ = high;
    scale_ = LogScale::of(std::move(drawn), from, to);
  }

  [[nodiscard]] double at(double value) const {
    return scale_.at(!(value > 0.0) ? zero_ : std::isinf(value) ? infinity_ : value);
  }

  [[nodiscard]] std::vector<Tick> ticks() const {
    std::vector<Tick> all;
    if (has_zero_) all.push_back({at(0.0), "0"});
    for (const double value : scale_.round_values()) {
      if ((has_zero_ && value < 0.5 * low_) || (has_infinity_ && value > 2.0 * high_)) continue;
      all.push_back({at(value), fmt::format("{:g}", value)});
    }
    if (has_infinity_) all.push_back({at(HUGE_VAL), "∞"});
    return all;
  }

 private:
  LogScale scale_;
  double zero_ = 0.0;
  double infinity_ = 0.0;
  double low_ = 0.0;
  double high_ = 0.0;
  bool has_zero_ = false;
  bool has_infinity_ = false;
};

void draw_curve(SvgCanvas& canvas, const Points& points, const Axis& x, const Axis& y, const Stroke& stroke) {
  std::vector<Point> line;
  for (const auto& [at, value] : points) line.push_back({x.at(at), y.at(value)});
  if (!line.empty()) canvas.polyline(line, stroke);
}

std::string plot_curve(const StabilityFinding& finding) {
  const StabilityCurve& curve = finding.curve;
  std::vector<double> xs;
  std::vector<double> ys{finding.limit};
  for (const Points* points : {&curve.points, &curve.expected}) {
    for (const auto& [at, value] : *points) {
      xs.push_back(at);
      ys.push_back(value);
    }
  }
  if (finding.breaks_at) xs.push_back(*finding.breaks_at);
  const Axis x(xs, kField.left + 16, kField.right - 16);
  const Axis y(ys, kField.bottom, kField.top);
  Plot plot(kField, fmt::format("{}: measured against its limit", finding.name),
            fmt::format("Measured {:.4g}, limit {:.4g} {}.", finding.measured, finding.limit, finding.unit));
  plot.draw_y_ticks(y.ticks());
  plot.draw_x_ticks(x.ticks());
  plot.draw_axis_lines();
  plot.name_x_axis(curve.x);
  plot.name_y_axis(finding.unit);

  SvgCanvas& canvas = plot.canvas();
  canvas.line({kField.left, y.at(finding.limit)}, {kField.right, y.at(finding.limit)}, kLimit);
  canvas.text({kField.right, y.at(finding.limit) - 5}, fmt::format("limit {:.3g}", finding.limit), Anchor::End);
  if (finding.breaks_at) {
    canvas.line({x.at(*finding.breaks_at), kField.top}, {x.at(*finding.breaks_at), kField.bottom}, kBreak);
    canvas.text({x.at(*finding.breaks_at) + 4, kField.top + 12}, fmt::format("breaks at {:.3g}", *finding.breaks_at));
  }
  draw_curve(canvas, curve.expected, x, y, kExpected);
  draw_curve(canvas, curve.points, x, y, kMeasured);
  for (const auto& [at, value] : curve.points) {
    canvas.circle({x.at(at), y.at(value)}, 3.4, kMeasured.color, {kMeasured.color, 0.5});
  }
  return plot.str();
}

/// JSON has no infinity: the largest number stands for it.
double finite(double value) {
  constexpr double kMax = std::numeric_limits<double>::max();
  return std::isnan(value) ? kMax : std::clamp(value, -kMax, kMax);
}

const std::vector<Column<StabilityFinding>>& finding_columns() {
  using Row = StabilityFinding;
  const auto style = [](std::string title, std::string format = "{}") {
    return ColumnStyle{.title = std::move(title), .format = std::move(format), .align = Align::Left, .gap = 2};
  };
  const auto for_people = [&](std::string title, std::string format = "{}") {
    ColumnStyle shown = style(std::move(title), std::move(format));
    shown.in_json = false;
    return shown;
  };
  ColumnStyle verdict = style("verdict");
  verdict.wrong = [](const Json& value) { return value == "breaks"; };
  static const std::vector<Column<Row>> columns{
      field<Row>("name", &Row::name, style("case")),
      field<Row>("parameter", &Row::parameter, style("parameter")),
      {"limit", [](const Row& row) { return Json(finite(row.limit)); }},
      {"measured", [](const Row& row) { return Json(finite(row.measured)); }},
      field<Row>("unit", &Row::unit, style("unit")),
      {"bound", [](const Row& row) { return Json(row.bound == Bound::AtMost ? "at-most" : "at-least"); }},
      {"verdict", [](const Row& row) { return Json(row.holds() ? "holds" : "breaks"); }, verdict},
      {"breaks_at", [](const Row& row) { return row.breaks_at ? Json(finite(*row.breaks_at)) : Json(); }},
      field<Row>("why", &Row::why),
      {"measured_value", [](const Row& row) { return Json(row.measured); }, for_people("measured", "{:.4g}")},
      {"limit_text",
       [](const Row& row) {
         return Json(fmt::format("{} {:.4g}", row.bound == Bound::AtMost ? "<=" : ">=", row.limit));
       },
       for_people("limit")},
      {"limit_words",
       [](const Row& row) {
         return Json(fmt::format("{} {:.4g}", row.bound == Bound::AtMost ? "at most" : "at least", row.limit));
       },
       for_people("limit")},
      {"breaks_at_text",
       [](const Row& row) {
         if (row.breaks_at) return Json(fmt::format("{:.3g}", *row.breaks_at));
         return Json(row.holds() ? "none found" : "-");
       },
       for_people("breaks at")},
      {"verdict_text", [](const Row& row) { return Json(row.holds() ? "holds" : "BREAKS"); }, for_people("verdict")}};
  return columns;
}

std::string section(const StabilityFinding& finding) {
  std::string text =
      fmt::format("<h3>{}</h3>\n<p>{}{} {}</p>\n", escape_markup(finding.name), escape_markup(finding.parameter),
                  finding.parameter.empty() ? "" : ".", escape_markup(finding.why));
  if (finding.curve.points.empty()) return text;
  return text +
         html_figure(plot_curve(finding), finding.curve.expected.empty() ? "" : "Dashed: what the derivation says.");
}

}  // namespace

double breaking_point(double good, double bad, double relative, const std::function<bool(double)>& holds) {
  HPR_CHECK(good * bad > 0.0 && relative > 0.0);
  const double sign = good < 0.0 ? -1.0 : 1.0;
  double inside = std::log(std::abs(good));
  double outside = std::log(std::abs(bad));
  while (std::abs(outside - inside) > std::log1p(relative)) {
    const double midpoint = 0.5 * (inside + outside);
    (holds(sign * std::exp(midpoint)) ? inside : outside) = midpoint;
  }
  return sign * std::exp(outside);
}

std::optional<double> breaking_point_if_any(double good, double bad, double relative,
                                            const std::function<bool(double)>& holds) {
  if (!holds(good)) return std::nullopt;
  const double decade = std::abs(bad) > std::abs(good) ? 10.0 : 0.1;
  for (double inside = good; inside != bad;) {
    const bool is_last = std::abs(std::log10(bad / inside)) <= 1.0;
    const double outside = is_last ? bad : inside * decade;
    if (!holds(outside)) return breaking_point(inside, outside, relative, holds);
    inside = outside;
  }
  return std::nullopt;
}

std::optional<double> breaking_point_of_curve(const StabilityFinding& finding) {
  const auto& points = finding.curve.points;
  const auto holds = [&](std::size_t i) { return finding.is_within(points[i].second); };
  std::optional<double> first;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (holds(i)) continue;
    if ((i > 0 && holds(i - 1)) || (i + 1 < points.size() && holds(i + 1))) return points[i].first;
    if (!first) first = points[i].first;
  }
  return first;
}

std::string stability_json(std::span<const StabilityFinding> findings) {
  return Json{{"schema", "hpr.stability/1"}, {"cases", Table(finding_columns(), findings).json()}}.dump(2) + "\n";
}

std::string stability_table(std::span<const StabilityFinding> findings) {
  const auto held = std::ranges::count_if(findings, &StabilityFinding::holds);
  return Table(finding_columns(), findings)
             .text({"name", "measured_value", "limit_text", "unit", "verdict_text", "breaks_at_text", "parameter"}) +
         fmt::format("{} of {} hold\n", held, findings.size());
}

std::string stability_html(std::span<const StabilityFinding> findings) {
  const auto held = std::ranges::count_if(findings, &StabilityFinding::holds);
  std::string body =
      html_heading("Numerical stability at the extremes",
                   std::array{Fact{"Result", fmt::format("{} of {} hold", held, findings.size())},
                              Fact{"Machine", this_machine().cpu}, Fact{"Commit", std::string(kCommit)}});
  body += Table(finding_columns(), findings)
              .html({"name", "measured_value", "limit_words", "unit", "verdict", "breaks_at_text", "parameter"},
                    {.caption = "The worst number within what is promised, and where along the parameter the promise "
                                "ends. docs/numerics.md derives the limits."});
  body += "<h2>Each number</h2>\n";
  for (const StabilityFinding& finding : findings) body += section(finding);
  return html_page("hpr stability", body);
}

}  // namespace hpr
