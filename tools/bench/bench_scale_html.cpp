#include "tools/bench/bench_scale_html.h"

#include <fmt/format.h>
#include <hpr/version.h>

#include <algorithm>
#include <iterator>
#include <set>

#include "tools/report/html_page.h"
#include "tools/report/lists.h"
#include "tools/report/markup.h"
#include "tools/report/plot_axes.h"

namespace hpr {
namespace {

constexpr double kWidth = 940.0;
constexpr double kHeight = 470.0;
constexpr double kLeft = 78.0;
constexpr double kRight = 700.0;  ///< of the field; names stand to the right of it
constexpr double kTop = 18.0;
constexpr double kBottom = 410.0;

/// The runs of one wall and one number of threads, by their ranks.
struct Series {
  std::string name;
  std::vector<ScaleRun> runs;
};

std::string name_of(const ScaleRun& run) {
  return fmt::format("{}, {} core{} a rank", grid_name(run.grid), run.threads, run.threads == 1 ? "" : "s");
}

std::vector<Series> series_of(const ScaleReport& report) {
  std::vector<Series> all;
  for (const ScaleRun& run : report.runs) {
    const std::string name = name_of(run);
    auto found = std::ranges::find(all, name, &Series::name);
    if (found == all.end()) found = all.insert(found, Series{name, {}});
    found->runs.push_back(run);
  }
  for (Series& series : all) std::ranges::stable_sort(series.runs, {}, &ScaleRun::ranks);
  return all;
}

struct Field {
  LogScale cores;
  LogScale speed_up;

  [[nodiscard]] Point at(const ScaleReport& report, const ScaleRun& run) const {
    return {cores.at(run.ranks * run.threads), speed_up.at(figures_of(report, run).speed_up)};
  }
};

void draw_axes(SvgDrawing& drawing, const Field& field, const std::set<int>& cores) {
  for (const double value : field.speed_up.ticks()) {
    drawing.line({kLeft, field.speed_up.at(value)}, {kRight, field.speed_up.at(value)}, kGridStroke);
    drawing.text({kLeft - 8, field.speed_up.at(value) + 4}, fmt::format("{:g}", value), Anchor::End);
  }
  for (const int count : cores) {
    drawing.line({field.cores.at(count), kTop}, {field.cores.at(count), kBottom}, kGridStroke);
    drawing.text({field.cores.at(count), kBottom + 18}, fmt::format("{}", count), Anchor::Middle);
  }
  drawing.upright_text({22, (kTop + kBottom) / 2}, "speed-up", 13);
  drawing.text({(kLeft + kRight) / 2, kBottom + 42}, "cores of all ranks", Anchor::Middle, 13);
  drawing.line({kLeft, kTop}, {kLeft, kBottom}, kAxisStroke);
  drawing.line({kLeft, kBottom}, {kRight, kBottom}, kAxisStroke);
}

std::string table(const ScaleReport& report) {
  std::string text =
      "<div class=\"wide\"><table>\n<caption>Milliseconds of a frame on the slowest rank, from its first triangle to "
      "its last tile on a screen. Speed-up and efficiency are against the least cores of the same wall; imbalance is "
      "the busiest rank by the mean.</caption>\n<thead><tr>";
  for (const char* name : {"tiles", "cores/rank", "ranks", "hosts", "median", "95 % from", "to", "speed-up",
                           "efficiency", "imbalance", "MB sent", "frame xxh64"})
    text += fmt::format("<th scope=\"col\">{}</th>", name);
  text += "</tr></thead>\n<tbody>\n";
  for (const ScaleRun& run : report.runs) {
    const ScaleFigures figures = figures_of(report, run);
    text += fmt::format(
        "<tr><th scope=\"row\">{}</th><td>{}</td><td>{}</td><td>{}</td><td>{:.2f}</td><td>{:.2f}</td><td>{:.2f}</td>"
        "<td>{:.2f}</td><td>{:.0f} %</td><td>{:.2f}</td><td>{:.2f}</td><td><code>{}</code></td></tr>\n",
        grid_name(run.grid), run.threads, run.ranks, run.hosts, figures.median_ms, figures.low_ms, figures.high_ms,
        figures.speed_up, 100.0 * figures.efficiency, figures.imbalance, static_cast<double>(run.bytes_sent) / 1e6,
        run.frame_xxh64);
  }
  return text + "</tbody></table></div>\n";
}

}  // namespace

std::string plot_speed_up(const ScaleReport& report) {
  SvgDrawing drawing(kWidth, kHeight, "Speed-up over the cores of all ranks", "The table has all figures.");
  std::set<int> cores;
  std::vector<double> speed_ups;
  for (const ScaleRun& run : report.runs) {
    cores.insert(run.ranks * run.threads);
    speed_ups.push_back(figures_of(report, run).speed_up);
  }
  const double most = static_cast<double>(*cores.rbegin()) / *cores.begin();
  speed_ups.push_back(most);
  const Field field{LogScale::of({cores.begin(), cores.end()}, kLeft + 30, kRight - 30),
                    LogScale::of(std::move(speed_ups), kBottom, kTop)};
  draw_axes(drawing, field, cores);
  drawing.line({field.cores.at(*cores.begin()), field.speed_up.at(1.0)},
               {field.cores.at(*cores.rbegin()), field.speed_up.at(most)}, {"#888888", 1.2, "2 4"});
  drawing.text({kRight + 26, kTop + 10}, "dotted: linear");

  const std::vector<Series> all = series_of(report);
  for (std::size_t i = 0; i < all.size(); ++i) {
    const SeriesLook& look = series_look(i);
    std::string points;
    for (const ScaleRun& run : all[i].runs) {
      const Point at = field.at(report, run);
      points += fmt::format("{:.1f},{:.1f} ", at.x, at.y);
      drawing.circle(at, 4.6, look.color, {look.color, 0.5});
    }
    drawing.polyline(points, {look.color, 1.8, look.dashes});
    const double y = kTop + 32.0 + 18.0 * static_cast<double>(i);
    drawing.line({kRight + 2, y}, {kRight + 20, y}, {look.color, 1.8, look.dashes});
    drawing.text({kRight + 26, y + 4}, all[i].name);
  }
  return drawing.str();
}

std::string scale_html(const ScaleReport& report) {
  std::string page = "<h1>Scaling with ranks and cores</h1>\n<dl>\n";
  page += html_entry("Input", fmt::format("{}, seed {}", report.input, report.seed));
  page += html_entry("Screens", fmt::format("of {}x{} pixels", report.size.width, report.size.height));
  page += html_entry("Machine", report.machine.cpu);
  page += html_entry("Cores", fmt::format("{}", report.machine.cores));
  page += html_entry("MPI", report.machine.mpi);
  page += html_entry("Frames", fmt::format("{} per run", report.runs.front().ms.size()));
  page += html_entry("Commit", kCommit);
  page += fmt::format("<dt>Command</dt><dd><code>{}</code></dd>\n</dl>\n", escape_markup(report.command));
  const auto crowded = [&](const ScaleRun& run) { return report.oversubscribed(run); };
  if (std::ranges::any_of(report.runs, crowded)) {
    page += "<p class=\"warning\">Some runs have more threads than the machine has cores.</p>\n";
  }
  for (const std::string& sentence : slow_ranks(report)) {
    page += fmt::format("<p class=\"warning\">{}</p>\n", escape_markup(sentence));
  }
  if (!pictures_agree(report)) page += "<p class=\"warning\">Not all runs of a wall made the same picture.</p>\n";
  page +=
      fmt::format("<figure>\n{}<figcaption>Medians against the least cores of the same wall.</figcaption>\n</figure>\n",
                  plot_speed_up(report));
  page += "<h2>All runs</h2>\n" + table(report);
  return html_page(fmt::format("hpr bench scale: {}", report.input), page);
}

}  // namespace hpr
