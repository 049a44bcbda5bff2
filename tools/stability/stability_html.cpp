#include <fmt/format.h>
#include <hpr/version.h>

#include <algorithm>
#include <cmath>

#include "app/doctor/doctor.h"
#include "tools/report/html_page.h"
#include "tools/report/markup.h"
#include "tools/report/plot_axes.h"
#include "tools/stability/stability.h"

namespace hpr {
namespace {

constexpr double kWidth = 720.0;
constexpr double kHeight = 330.0;
constexpr double kLeft = 86.0;
constexpr double kRight = 700.0;
constexpr double kTop = 18.0;
constexpr double kBottom = 270.0;
constexpr Stroke kMeasured{"#332288", 1.8};
constexpr Stroke kExpected{"#117733", 1.6, "7 4"};
constexpr Stroke kLimit{"#8a3c00", 1.4};
constexpr Stroke kBreak{"#8a3c00", 1.2, "2 3"};

using Points = std::vector<std::pair<double, double>>;

/// One coordinate of a plot. Zero has no place on a logarithmic scale, nor has infinity: they stand at its ends.
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
    const auto [least, most] = std::ranges::minmax(drawn);
    zero_ = least / 10.0;
    infinity_ = most * 10.0;
    if (has_zero_) drawn.push_back(zero_);
    if (has_infinity_) drawn.push_back(infinity_);
    least_ = least;
    most_ = most;
    scale_ = LogScale::of(std::move(drawn), from, to);
  }

  [[nodiscard]] double at(double value) const {
    return scale_.at(!(value > 0.0) ? zero_ : std::isinf(value) ? infinity_ : value);
  }

  /// Places and their names.
  [[nodiscard]] std::vector<std::pair<double, std::string>> ticks() const {
    std::vector<std::pair<double, std::string>> all;
    if (has_zero_) all.emplace_back(at(0.0), "0");
    for (const double value : scale_.ticks()) {
      if ((has_zero_ && value < 0.5 * least_) || (has_infinity_ && value > 2.0 * most_)) continue;
      all.emplace_back(at(value), fmt::format("{:g}", value));
    }
    if (has_infinity_) all.emplace_back(at(HUGE_VAL), "∞");
    return all;
  }

 private:
  LogScale scale_;
  double zero_ = 0.0;
  double infinity_ = 0.0;
  double least_ = 0.0;
  double most_ = 0.0;
  bool has_zero_ = false;
  bool has_infinity_ = false;
};

void draw_curve(SvgDrawing& drawing, const Points& points, const Axis& x, const Axis& y, const Stroke& stroke) {
  std::string text;
  for (const auto& [at, value] : points) text += fmt::format("{:.1f},{:.1f} ", x.at(at), y.at(value));
  if (!text.empty()) drawing.polyline(text, stroke);
}

std::string plot(const StabilityFinding& finding) {
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
  const Axis x(xs, kLeft + 16, kRight - 16);
  const Axis y(ys, kBottom, kTop);
  SvgDrawing drawing(kWidth, kHeight, fmt::format("{}: measured against its limit", finding.name),
                     fmt::format("Measured {:.4g}, limit {:.4g} {}.", finding.measured, finding.limit, finding.unit));
  for (const auto& [place, name] : y.ticks()) {
    drawing.line({kLeft, place}, {kRight, place}, kGridStroke);
    drawing.text({kLeft - 8, place + 4}, name, Anchor::End);
  }
  for (const auto& [place, name] : x.ticks()) {
    drawing.line({place, kTop}, {place, kBottom}, kGridStroke);
    drawing.text({place, kBottom + 18}, name, Anchor::Middle);
  }
  drawing.line({kLeft, kTop}, {kLeft, kBottom}, kAxisStroke);
  drawing.line({kLeft, kBottom}, {kRight, kBottom}, kAxisStroke);
  drawing.text({(kLeft + kRight) / 2, kBottom + 40}, curve.x, Anchor::Middle, 13);
  drawing.upright_text({18, (kTop + kBottom) / 2}, finding.unit, 13);

  drawing.line({kLeft, y.at(finding.limit)}, {kRight, y.at(finding.limit)}, kLimit);
  drawing.text({kRight, y.at(finding.limit) - 5}, fmt::format("limit {:.3g}", finding.limit), Anchor::End);
  if (finding.breaks_at) {
    drawing.line({x.at(*finding.breaks_at), kTop}, {x.at(*finding.breaks_at), kBottom}, kBreak);
    drawing.text({x.at(*finding.breaks_at) + 4, kTop + 12}, fmt::format("breaks at {:.3g}", *finding.breaks_at));
  }
  draw_curve(drawing, curve.expected, x, y, kExpected);
  draw_curve(drawing, curve.points, x, y, kMeasured);
  for (const auto& [at, value] : curve.points) {
    drawing.circle({x.at(at), y.at(value)}, 3.4, kMeasured.color, {kMeasured.color, 0.5});
  }
  return drawing.str();
}

std::string row(const StabilityFinding& finding) {
  const char* const sign = finding.bound == Bound::AtMost ? "at most" : "at least";
  return fmt::format(
      "<tr><th scope=\"row\">{}</th><td>{:.4g}</td><td>{} {:.4g}</td><td>{}</td><td{}>{}</td><td>{}</td><td>{}</td>"
      "</tr>\n",
      escape_markup(finding.name), finding.measured, sign, finding.limit, escape_markup(finding.unit),
      finding.holds() ? "" : " class=\"wrong\"", finding.holds() ? "holds" : "breaks",
      finding.breaks_at ? fmt::format("{:.3g}", *finding.breaks_at) : "–", escape_markup(finding.parameter));
}

std::string section(const StabilityFinding& finding) {
  std::string text =
      fmt::format("<h3>{}</h3>\n<p>{}{} {}</p>\n", escape_markup(finding.name), escape_markup(finding.parameter),
                  finding.parameter.empty() ? "" : ".", escape_markup(finding.why));
  if (finding.curve.points.empty()) return text;
  text += "<figure>\n" + plot(finding);
  if (!finding.curve.expected.empty()) text += "<figcaption>Dashed: what the derivation says.</figcaption>\n";
  return text + "</figure>\n";
}

}  // namespace

std::string stability_html(std::span<const StabilityFinding> findings) {
  const auto held = std::ranges::count_if(findings, [](const StabilityFinding& f) { return f.holds(); });
  const Machine machine = this_machine();
  std::string body = "<h1>Numerical stability at the extremes</h1>\n<dl>\n";
  body += html_entry("Result", fmt::format("{} of {} hold", held, findings.size()));
  body += html_entry("Machine", machine.cpu) + html_entry("Commit", kCommit) + "</dl>\n";
  body += "<div class=\"wide\"><table>\n<caption>The worst number within what is promised, and where along the ";
  body += "parameter the promise ends. docs/numerics.md derives the limits.</caption>\n<thead><tr>";
  for (const char* name : {"case", "measured", "limit", "unit", "verdict", "breaks at", "parameter"}) {
    body += fmt::format("<th scope=\"col\">{}</th>", name);
  }
  body += "</tr></thead>\n<tbody>\n";
  for (const StabilityFinding& finding : findings) body += row(finding);
  body += "</tbody></table></div>\n<h2>Each number</h2>\n";
  for (const StabilityFinding& finding : findings) body += section(finding);
  return html_page("hpr stability", body);
}

}  // namespace hpr
