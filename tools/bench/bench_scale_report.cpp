#include "tools/bench/bench_scale_report.h"

#include <fmt/format.h>
#include <hpr/version.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/error.h"
#include "core/json.h"
#include "tools/compare/compare_measure.h"
#include "tools/report/lists.h"

namespace hpr {
namespace {

int cores_of(const ScaleRun& run) {
  return run.ranks * run.threads;
}

/// The run of the same wall with the least cores; of several, that with the fewest ranks.
const ScaleRun& base_of(const ScaleReport& report, const ScaleRun& run) {
  const ScaleRun* base = &run;
  for (const ScaleRun& other : report.runs) {
    if (other.grid != run.grid) continue;
    if (std::pair(cores_of(other), other.ranks) < std::pair(cores_of(*base), base->ranks)) base = &other;
  }
  return *base;
}

/// A 95 % interval of the median of any distribution: the ranks of order that the normal approximation of the binomial
/// gives (Conover, Practical Nonparametric Statistics, 3.2); all values where those are too few.
std::pair<double, double> median_interval(std::vector<double> values) {
  std::ranges::sort(values);
  const auto count = static_cast<double>(values.size());
  const double half = 0.98 * std::sqrt(count);  // 1.96 / 2
  const auto low = static_cast<std::size_t>(std::clamp(std::floor(count / 2.0 - half), 0.0, count - 1.0));
  const auto high = static_cast<std::size_t>(std::clamp(std::ceil(count / 2.0 + half), 0.0, count - 1.0));
  return {values[low], values[high]};
}

double mean_of(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

}  // namespace

bool ScaleReport::oversubscribed(const ScaleRun& run) const {
  return cores_of(run) > machine.cores * run.hosts;
}

ScaleFigures figures_of(const ScaleReport& report, const ScaleRun& run) {
  HPR_CHECK(!run.ms.empty());
  const ScaleRun& base = base_of(report, run);
  ScaleFigures figures;
  figures.median_ms = spread_of(run.ms).median;
  std::tie(figures.low_ms, figures.high_ms) = median_interval(run.ms);
  if (figures.median_ms > 0.0) figures.speed_up = spread_of(base.ms).median / figures.median_ms;
  figures.efficiency = figures.speed_up * cores_of(base) / cores_of(run);
  const double mean = mean_of(run.rank_ms);
  if (mean > 0.0) figures.imbalance = std::ranges::max(run.rank_ms) / mean;
  return figures;
}

std::vector<std::string> slow_ranks(const ScaleReport& report) {
  constexpr double kSlow = 1.5;
  std::vector<std::string> sentences;
  for (const ScaleRun& run : report.runs) {
    const double middle = spread_of(run.rank_ms).median;
    for (std::size_t rank = 0; rank < run.rank_ms.size() && run.ranks > 2; ++rank) {
      if (run.rank_ms[rank] <= kSlow * middle) continue;
      sentences.push_back(
          fmt::format("rank {} of {} with {} cores was busy for {:.1f} ms of a frame of {}, the middle one for {:.1f}",
                      rank, run.ranks, run.threads, run.rank_ms[rank], grid_name(run.grid), middle));
    }
  }
  return sentences;
}

bool pictures_agree(const ScaleReport& report) {
  return std::ranges::all_of(report.runs, [&](const ScaleRun& run) {
    return run.frame_xxh64 == base_of(report, run).frame_xxh64 && run.frame_xxh64 != kDiffering;
  });
}

std::string scale_table(const ScaleReport& report) {
  std::string text = fmt::format("{}, screens of {}x{}, seed {}, {} frames each; {}, {} cores, {}\n", report.input,
                                 report.size.width, report.size.height, report.seed, report.runs.front().ms.size(),
                                 report.machine.cpu, report.machine.cores, report.machine.mpi);
  text += fmt::format("{:<7} {:>10} {:>5} {:>5} {:>9} {:>20} {:>8} {:>10} {:>9} {:>8}  {}\n", "tiles", "cores/rank",
                      "ranks", "hosts", "ms", "95 % of the median", "speed-up", "efficiency", "imbalance", "MB sent",
                      "frame");
  for (const ScaleRun& run : report.runs) {
    const ScaleFigures figures = figures_of(report, run);
    text += fmt::format("{:<7} {:>10} {:>5} {:>5} {:>9.1f} {:>20} {:>8.2f} {:>8.0f} % {:>9.2f} {:>8.2f}  {}{}\n",
                        grid_name(run.grid), run.threads, run.ranks, run.hosts, figures.median_ms,
                        fmt::format("{:.1f} .. {:.1f}", figures.low_ms, figures.high_ms), figures.speed_up,
                        100.0 * figures.efficiency, figures.imbalance, static_cast<double>(run.bytes_sent) / 1e6,
                        run.frame_xxh64, report.oversubscribed(run) ? "  (more than the machine's cores)" : "");
  }
  return text;
}

std::string scale_json(const ScaleReport& report) {
  Json json{{"schema", "hpr.bench-scale/1"},
            {"command", report.command},
            {"commit", std::string(kCommit)},
            {"machine", {{"cpu", report.machine.cpu}, {"cores", report.machine.cores}, {"mpi", report.machine.mpi}}},
            {"input", report.input},
            {"screen", {{"width", report.size.width}, {"height", report.size.height}}},
            {"seed", report.seed},
            {"pictures_agree", pictures_agree(report)},
            {"runs", Json::array()}};
  for (const ScaleRun& run : report.runs) {
    const ScaleFigures figures = figures_of(report, run);
    const Spread ms = spread_of(run.ms);
    json["runs"].push_back({{"tiles", grid_name(run.grid)},
                            {"ranks", run.ranks},
                            {"threads", run.threads},
                            {"hosts", run.hosts},
                            {"oversubscribed", report.oversubscribed(run)},
                            {"frames", run.ms.size()},
                            {"ms", {{"min", ms.min}, {"median", ms.median}, {"p95", ms.p95}, {"max", ms.max}}},
                            {"median_interval", Json::array({figures.low_ms, figures.high_ms})},
                            {"speed_up", figures.speed_up},
                            {"efficiency", figures.efficiency},
                            {"imbalance", figures.imbalance},
                            {"rank_ms", run.rank_ms},
                            {"bytes_sent", run.bytes_sent},
                            {"frame_xxh64", run.frame_xxh64 == kDiffering ? Json() : Json(run.frame_xxh64)}});
  }
  return json.dump(2) + "\n";
}

std::string scale_csv(const ScaleReport& report) {
  std::string text = "tiles,threads,ranks,hosts,frame,ms\n";
  for (const ScaleRun& run : report.runs) {
    for (std::size_t frame = 0; frame < run.ms.size(); ++frame) {
      text += fmt::format("{},{},{},{},{},{:.6f}\n", grid_name(run.grid), run.threads, run.ranks, run.hosts, frame,
                          run.ms[frame]);
    }
  }
  return text;
}

}  // namespace hpr
