#include "tools/tradeoff/tradeoff_html.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <hpr/version.h>

#include <algorithm>
#include <cmath>

#include "tools/report/html_page.h"
#include "tools/report/markup.h"
#include "tools/tradeoff/tradeoff_plots.h"
#include "tools/tradeoff/tradeoff_report.h"

namespace hpr {
namespace {

std::string header(const TradeoffReport& report) {
  std::string text = "<h1>Speed against accuracy</h1>\n<dl>\n";
  text += html_entry("Scene", fmt::format("{}, {}x{} pixels, seed {}", report.scene, report.size.width,
                                          report.size.height, report.seed));
  const TradeoffReference& reference = report.reference;
  std::string truth = reference.how;
  if (reference.spp > 0) truth += fmt::format(", {} samples", reference.spp);
  if (std::isfinite(reference.relmse)) truth += fmt::format(", its own relMSE about {:.2g}", reference.relmse);
  text += html_entry("Truth", truth);
  text +=
      html_entry("Machine", fmt::format("{}, {} rank{} of {} thread{}", report.machine.cpu, report.ranks,
                                        report.ranks == 1 ? "" : "s", report.threads, report.threads == 1 ? "" : "s"));
  text += html_entry("Commit", kCommit);
  text += fmt::format("<dt>Command</dt><dd><code>{}</code></dd>\n</dl>\n", escape_markup(report.command));
  if (report.budget) {
    text += fmt::format("<p><strong>{}.</strong></p>\n", escape_markup(answer(report)));
    if (report.best) {
      text += fmt::format("<p><code>{}</code></p>\n", escape_markup(command_for(report, report.points[*report.best])));
    }
  }
  return text;
}

std::string cell(const std::string& metric, double value) {
  if (std::isnan(value)) return "<td>–</td>";
  if (std::isinf(value)) return "<td>∞</td>";
  if (metric == "mean") return fmt::format("<td>{:.3g}</td>", value);
  return metric == "psnr" ? fmt::format("<td>{:.2f}</td>", value) : fmt::format("<td>{:.4g}</td>", value);
}

std::string table(const TradeoffReport& report) {
  std::string text = "<div class=\"wide\"><table>\n<caption>Median milliseconds of a frame and how far it is from the ";
  text += fmt::format("truth; rows that nothing beats in both time and {} are marked.", report.metrics.front());
  text += "</caption>\n<thead><tr><th scope=\"col\">#</th>";
  const auto head = [&](std::string_view name) {
    text += fmt::format("<th scope=\"col\">{}</th>", escape_markup(name));
  };
  for (const std::string& knob : report.knobs) head(knob);
  head("ms");
  for (const std::string& metric : report.metrics) head(metric);
  for (const char* name : {"signed mean, %", "its standard error", "largest difference", "at"}) head(name);
  text += "</tr></thead>\n<tbody>\n";
  const double percent = report.reference.mean > 0.0 ? 100.0 / report.reference.mean : std::nan("");
  for (std::size_t i = 0; i < report.points.size(); ++i) {
    const TradeoffPoint& point = report.points[i];
    text += fmt::format("<tr{}><th scope=\"row\">{}</th>", point.pareto ? " class=\"fastest\"" : "", i + 1);
    for (const auto& [knob, value] : point.knobs) text += fmt::format("<td>{}</td>", escape_markup(value));
    text += fmt::format("<td>{:.1f}</td>", point.median_ms());
    for (const std::string& metric : report.metrics) text += cell(metric, point.error.of(metric));
    const auto width = static_cast<std::size_t>(report.size.width);
    for (const double share : {point.error.mean, point.error.mean_error}) text += cell("mean", percent * share);
    text += fmt::format("<td>{:.3g}</td><td>{},{}</td></tr>\n", point.error.worst, point.error.worst_pixel % width,
                        point.error.worst_pixel / width);
  }
  return text + "</tbody></table></div>\n";
}

std::string slopes(const TradeoffReport& report) {
  std::string rows;
  for (const KnobSlope& slope : knob_slopes(report.points, report.metrics)) {
    if (slope.points < 3) continue;
    rows += fmt::format("<tr><th scope=\"row\">{}</th><td>{}</td><td>{:+.3f}</td><td>{:.3f}</td><td>{}</td></tr>\n",
                        escape_markup(slope.knob), slope.metric, slope.slope, slope.spread,
                        escape_markup(describe(slope.others)));
  }
  if (rows.empty()) return {};
  return "<h2>How errors go with a knob</h2>\n<p>The power of the knob an error goes with while the other knobs stand "
         "still: the slope of the line through the logarithms. Pure noise has -1 over samples by relMSE; what does not "
         "fall is bias.</p>\n<div class=\"wide\"><table><thead><tr><th scope=\"col\">knob</th><th scope=\"col\">metric"
         "</th><th scope=\"col\">power</th><th scope=\"col\">its standard error</th><th scope=\"col\">at</th></tr>"
         "</thead>\n<tbody>\n" +
         rows + "</tbody></table></div>\n";
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

}  // namespace

namespace {

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

std::string tradeoff_html(const TradeoffReport& report) {
  std::string body = header(report);
  for (const std::string& metric : report.metrics) {
    const std::string svg = plot_error_over_time(report, metric);
    if (svg.empty()) continue;
    body += fmt::format(
        "<figure>\n{}<figcaption>Error by {} over time; numbers are rows of the table, filled marks are "
        "those nothing beats by {}.{}</figcaption>\n</figure>\n",
        svg, metric, report.metrics.front(), left_out(report, metric));
  }
  body += "<h2>All points</h2>\n" + table(report) + slopes(report);
  body += "<h2>Where the time goes</h2>\n<figure>\n" + plot_shares_of_passes(report) +
          "<figcaption>Shares of the passes in each point's time; times of threads are added up.</figcaption>\n"
          "</figure>\n";
  body += crops(report);
  return html_page("hpr tradeoff", body);
}

}  // namespace hpr
