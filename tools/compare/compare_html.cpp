#include "tools/compare/compare_html.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <hpr/version.h>

#include <algorithm>
#include <map>

#include "tools/compare/compare_plots.h"
#include "tools/compare/schedule_drawing.h"
#include "tools/report/html_page.h"
#include "tools/report/markup.h"

namespace hpr {
namespace {

constexpr int kMostRanksDrawn = 16;

std::string header(const CompareReport& report) {
  const CompareRun& first = report.runs.front();
  std::string text = "<h1>Compositing strategies compared</h1>\n<dl>\n";
  text += html_entry("Input", fmt::format("{}, seed {}", report.input, report.seed));
  const std::string screens = report.grid.area() == 1
                                  ? std::string("one screen")
                                  : fmt::format("{}x{} screens", report.grid.width, report.grid.height);
  text += html_entry("Wall", fmt::format("{} of {}x{} pixels", screens, report.screen.width, report.screen.height));
  text += html_entry("Operator", report.operation);
  text += html_entry("Machine", report.machine.cpu);
  text += html_entry("Cores", fmt::format("{}{}", report.machine.cores,
                                          report.oversubscribed() ? ", oversubscribed" : ", not oversubscribed"));
  text += html_entry("MPI", report.machine.mpi);
  text += html_entry("Transport", first.transport);
  text += html_entry("Frames", fmt::format("{} per run", first.frames));
  text += html_entry("Commit", kCommit);
  text += fmt::format("<dt>Command</dt><dd><code>{}</code></dd>\n</dl>\n", escape_markup(report.command));
  if (report.oversubscribed()) {
    text +=
        "<p class=\"warning\">Some runs have more ranks than cores: their times say how the cores were shared as much "
        "as what a strategy costs.</p>\n";
  }
  return text;
}

/// Per number of ranks the best median.
std::map<int, double> fastest(const std::vector<CompareRun>& runs) {
  std::map<int, double> best;
  for (const CompareRun& run : runs) {
    const auto [found, is_new] = best.try_emplace(run.ranks, run.ms.median);
    if (!is_new) found->second = std::min(found->second, run.ms.median);
  }
  return best;
}

std::string summary(const CompareReport& report) {
  std::string text = "<ul>\n";
  for (const auto& [ranks, ms] : fastest(report.runs)) {
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

std::string row(const CompareRun& run, bool is_fastest) {
  const std::string name = run.chosen.empty() ? run.strategy : fmt::format("{} ({})", run.strategy, run.chosen);
  std::string cells = fmt::format("<th scope=\"row\">{}</th><td>{}</td>", escape_markup(name), run.ranks);
  for (const double ms : {run.ms.median, run.ms.min, run.ms.p95, run.ms.max, run.ms_composite, run.ms_collect}) {
    cells += fmt::format("<td>{:.3f}</td>", ms);
  }
  cells += run.predicted_ms ? fmt::format("<td>{:.3f}</td>", *run.predicted_ms) : "<td>–</td>";
  cells += fmt::format("<td>{:.2f}</td><td>{:.2f}</td><td>{}</td><td>{:.2f}</td>",
                       static_cast<double>(run.bytes_total) / 1e6, static_cast<double>(run.bytes_max_rank) / 1e6,
                       run.messages_total, run.imbalance);
  cells += fmt::format("<td{}>{}</td><td><code>{}</code></td>", run.differing_pixels > 0 ? " class=\"wrong\"" : "",
                       run.differing_pixels, escape_markup(run.frame_xxh64));
  return fmt::format("<tr{}>{}</tr>\n", is_fastest ? " class=\"fastest\"" : "", cells);
}

std::string table(const CompareReport& report) {
  std::string text =
      "<div class=\"wide\"><table>\n<caption>Milliseconds of a frame on the slowest rank, compositing and collecting "
      "it on rank 0; MB and messages are of one frame. Imbalance: slowest rank by mean of ranks. The fastest median of "
      "each number of ranks is marked.</caption>\n<thead><tr>";
  for (const char* name : {"strategy", "ranks", "median", "min", "p95", "max", "composite", "collect", "predicted",
                           "MB sent", "MB of busiest rank", "messages", "imbalance", "differing pixels", "frame xxh64"})
    text += fmt::format("<th scope=\"col\">{}</th>", name);
  text += "</tr></thead>\n<tbody>\n";
  const auto best = fastest(report.runs);
  int ranks = report.runs.front().ranks;
  for (const CompareRun& run : report.runs) {
    if (run.ranks != ranks) text += "</tbody>\n<tbody>\n";
    ranks = run.ranks;
    text += row(run, run.ms.median == best.at(run.ranks));
  }
  return text + "</tbody></table></div>\n";
}

std::string figure(const std::string& svg, std::string_view caption) {
  return fmt::format("<figure>\n{}<figcaption>{}</figcaption>\n</figure>\n", svg, caption);
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

/// What to draw a strategy on: the most ranks it was compared on, 16 in place of more; 0 when it does not run on those.
int ranks_to_draw(const Compositor& compositor, const std::vector<CompareRun>& runs) {
  int most = 0;
  for (const CompareRun& run : runs) {
    const int ranks = std::min(run.ranks, kMostRanksDrawn);
    if (run.strategy == compositor.name() && compositor.fits(ranks)) most = std::max(most, ranks);
  }
  return most;
}

/// "tree, ring": what a strategy chose in its place, on whatever number of ranks.
std::string choices_of(std::string_view strategy, const std::vector<CompareRun>& runs) {
  std::vector<std::string> choices;
  for (const CompareRun& run : runs) {
    if (run.strategy != strategy || run.chosen.empty()) continue;
    if (std::ranges::find(choices, run.chosen) == choices.end()) choices.push_back(run.chosen);
  }
  return fmt::format("{}", fmt::join(choices, ", "));
}

StrategyDrawing draw_strategy(const std::string& strategy, const std::vector<CompareRun>& runs) {
  if (strategy == kSortFirst) return {strategy, 0, {}, "Every rank draws tiles of its own: only the collect is left."};
  const std::string choices = choices_of(strategy, runs);
  if (!choices.empty()) return {strategy, 0, {}, fmt::format("It chose {}.", choices)};
  const auto make = [&] { return make_compositor(strategy); };
  const int ranks = ranks_to_draw(*make(), runs);
  if (ranks == 0) {
    return {strategy, 0, {}, fmt::format("It runs on no number of ranks up to {} compared here.", kMostRanksDrawn)};
  }
  return {strategy, ranks, draw_schedule(strategy, record_frame(make, {.size = ranks})), {}};
}

}  // namespace

std::vector<StrategyDrawing> draw_strategies(const std::vector<CompareRun>& runs) {
  std::vector<StrategyDrawing> drawings;
  for (const CompareRun& run : runs) {
    if (std::ranges::find(drawings, run.strategy, &StrategyDrawing::strategy) != drawings.end()) continue;
    drawings.push_back(draw_strategy(run.strategy, runs));
  }
  return drawings;
}

std::string compare_html(const CompareReport& report, const std::vector<StrategyDrawing>& drawings) {
  std::string page = header(report) + summary(report);
  page += "<h2>Time over ranks</h2>\n";
  page +=
      figure(plot_time_over_ranks(report.runs),
             "Median of the frames; whiskers reach from the fastest frame to the 95th percentile. Hollow marks, where "
             "there are any, are what the cost model predicts.");
  page += "<h2>Time against bytes</h2>\n";
  page += figure(plot_time_against_bytes(report.runs),
                 "The numbers beside the marks are ranks. What ranks read of each other's memory is not sent. Runs on "
                 "one rank are left out.");
  page += "<h2>All runs</h2>\n" + table(report);
  page += schedules(drawings);
  return html_page(fmt::format("hpr compare: {}", report.input), page);
}

}  // namespace hpr
