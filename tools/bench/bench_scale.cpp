#include "tools/bench/bench_scale.h"

#include <fmt/format.h>
#include <hpr/version.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <set>
#include <span>

#include "cluster/transport/collectives.h"
#include "core/bytes.h"
#include "core/error.h"
#include "core/progress.h"
#include "engine/checkpoint/checkpoint.h"
#include "engine/frame_sampler.h"
#include "engine/output.h"
#include "engine/session.h"
#include "engine/wall/wall_displays.h"
#include "rt/deferred_shader.h"
#include "tools/report/canvas.h"
#include "tools/report/plot.h"
#include "tools/sweep.h"
#include "walls/config/wall_file.h"
#include "walls/geometry/geometry.h"

namespace hpr {
namespace {

/// The frames of one wall, measured in one job.
class WallBench {
 public:
  /// Collective.
  WallBench(Session& session, const ScaleInput& input, Size grid, const std::vector<std::string>& hosts)
      : session_(session), input_(input), sampling_(input.settings.sampling) {
    const Wall wall = load_wall(wall_of(grid, input.size));
    const Scene& scene = session.scene();
    const std::vector<View> screens = wall_views(wall, choose_camera(input.settings.camera, scene), scene.bounds);
    const FrameSettings& settings = input.settings.frame;
    blocks_ = cut_blocks(screens, settings.resolution_scale);
    showing_.transform = fixed_transform(input.settings.display);
    showing_.shown_by = owners_of(wall, hosts, false);
    for (const View& screen : screens) showing_.sizes.push_back(screen.screen);
    plan_ = plan_frame(session, settings, blocks_.views);
    prepare(session, plan_);
    run_.grid = grid;
    run_.ranks = session.comm().size();
    run_.threads = session.threads();
    run_.hosts = static_cast<int>(std::set<std::string>(hosts.begin(), hosts.end()).size());
    const std::vector<std::string> gpus = all_gather_texts(session.comm(), session.gpu());
    std::set<std::string> used(gpus.begin(), gpus.end());
    used.erase("");
    run_.gpus = static_cast<int>(used.size());
  }

  /// Collective. On rank 0 what was measured.
  [[nodiscard]] ScaleRun draw(int frames) {
    std::vector<std::vector<double>> of_ranks(static_cast<std::size_t>(run_.ranks));
    measure_in_turns(1, {input_.warmup, frames}, [&](std::size_t /*contender*/, bool counts) {
      const std::vector<Times> all = all_gather_value(session_.comm(), draw_one());
      if (!counts) return;
      run_.ms.push_back(std::ranges::max(all, {}, &Times::shown_ms).shown_ms);
      run_.bytes_sent = 0;
      for (std::size_t rank = 0; rank < all.size(); ++rank) {
        of_ranks[rank].push_back(all[rank].busy_ms);
        run_.bytes_sent += all[rank].bytes;
      }
    });
    for (std::vector<double>& times : of_ranks) run_.rank_ms.push_back(median(std::move(times)));
    run_.frame_xxh64 = hash_of_screens();
    return run_;
  }

 private:
  struct Times {
    double busy_ms = 0.0;
    double shown_ms = 0.0;
    std::uint64_t bytes = 0;
  };

  Times draw_one() {
    CountingCommunicator& comm = session_.comm();
    session_.shader(plan_.rays).discard_photons();  // of the same sample, in the frame before
    barrier(comm);
    const std::size_t bytes_before = comm.bytes_sent();
    const double start = comm.seconds();
    Progress silent("none", "sample", 0);
    FrameSampler sampler(session_, plan_, sampling_, 0, false);
    (void)sampler.draw(blocks_.views, {}, silent);  // it stops before its goal for a checkpoint only
    double busy = sampler.times().primary_ms;
    for (const PassTime& pass : sampler.times().passes) busy += pass.ms / session_.threads();
    screens_ = bring_to_screens(session_, sampler.frame(), blocks_, showing_);
    return {busy, (comm.seconds() - start) * 1e3, comm.bytes_sent() - bytes_before};
  }

  /// Collective.
  std::string hash_of_screens() {
    std::vector<std::uint64_t> hashes;
    for (std::size_t screen = 0; screen < showing_.sizes.size(); ++screen) {
      const std::uint64_t mine = xxh64(std::as_bytes(screens_[screen].pixels()));
      const auto all = all_gather_value(session_.comm(), mine);
      hashes.push_back(all.at(static_cast<std::size_t>(showing_.shown_by[screen])));
    }
    return hex16(hashes.size() == 1 ? hashes.front() : xxh64(std::as_bytes(std::span(hashes))));
  }

  Session& session_;
  const ScaleInput& input_;
  Sampling sampling_;
  Showing showing_;
  Blocks blocks_;
  FramePlan plan_;
  std::vector<Image<Rgba8>> screens_;
  ScaleRun run_;
};

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

/// A 95 % interval of the median of any distribution: the ranks of order that the normal approximation of the
/// binomial gives (Conover, Practical Nonparametric Statistics, 3.2); all values where those are too few.
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

/// The columns of a report's runs.
std::vector<Column<ScaleRun>> report_columns(const ScaleReport& report) {
  using Run = ScaleRun;
  const auto figure = [&](std::string key, double ScaleFigures::*member, ColumnStyle style) {
    return Column<Run>{std::move(key),
                       [&report, member](const Run& run) { return Json(figures_of(report, run).*member); },
                       std::move(style)};
  };
  const auto spread = [](std::string key, double Spread::*member) {
    return Column<Run>{std::move(key), [member](const Run& run) { return Json(spread_of(run.ms).*member); }};
  };
  return {
      {"tiles",
       [](const Run& run) { return Json(grid_name(run.grid)); },
       {.title = "tiles", .align = Align::Left, .width = 7}},
      field<Run>("ranks", &Run::ranks, {.title = "ranks", .width = 5}),
      field<Run>("threads", &Run::threads, {.title = "cores/rank", .width = 10}),
      field<Run>("gpus", &Run::gpus, {.title = "GPUs", .width = 5}),
      field<Run>("hosts", &Run::hosts, {.title = "hosts", .width = 5}),
      {"oversubscribed", [&](const Run& run) { return Json(report.oversubscribed(run)); }},
      {"frames", [](const Run& run) { return Json(run.ms.size()); }},
      spread("ms.min", &Spread::min),
      spread("ms.median", &Spread::median),
      spread("ms.p95", &Spread::p95),
      spread("ms.max", &Spread::max),
      {"median_interval",
       [&](const Run& run) {
         const ScaleFigures figures = figures_of(report, run);
         return Json::array({figures.low_ms, figures.high_ms});
       }},
      figure("speed_up", &ScaleFigures::speed_up, {.title = "speed-up", .format = "{:.2f}", .width = 8}),
      figure("efficiency", &ScaleFigures::efficiency, {}),
      figure("imbalance", &ScaleFigures::imbalance, {.title = "imbalance", .format = "{:.2f}", .width = 9}),
      field<Run>("rank_ms", &Run::rank_ms),
      field<Run>("bytes_sent", &Run::bytes_sent, {.title = "MB sent", .format = "{:.2f}", .scale = 1e-6, .width = 8}),
      {"frame_xxh64", [](const Run& run) { return run.frame_xxh64 == kDiffering ? Json() : Json(run.frame_xxh64); }},
      figure("median", &ScaleFigures::median_ms,
             {.title = "ms",
              .html_title = "median",
              .format = "{:.1f}",
              .html_format = "{:.2f}",
              .width = 9,
              .in_json = false}),
      figure("low", &ScaleFigures::low_ms, {.title = "95 % from", .format = "{:.2f}", .in_json = false}),
      figure("high", &ScaleFigures::high_ms, {.title = "to", .format = "{:.2f}", .in_json = false}),
      {"interval",
       [&](const Run& run) {
         const ScaleFigures figures = figures_of(report, run);
         return Json(fmt::format("{:.1f} .. {:.1f}", figures.low_ms, figures.high_ms));
       },
       {.title = "95 % of the median", .width = 20, .in_json = false}},
      figure("percent", &ScaleFigures::efficiency,
             {.title = "efficiency", .format = "{:.0f} %", .scale = 100.0, .width = 10, .in_json = false}),
      {"frame",
       [](const Run& run) { return Json(run.frame_xxh64); },
       {.title = "frame", .html_title = "frame xxh64", .align = Align::Left, .gap = 2, .in_json = false, .code = true}},
      {"note",
       [&](const Run& run) { return Json(report.oversubscribed(run) ? "(more than the machine's cores)" : ""); },
       {.align = Align::Left, .gap = 2, .in_json = false}}};
}

constexpr PlotLayout kField{.right = 700.0};

/// The runs of one wall and one number of threads, by their ranks.
struct Series {
  std::string name;
  std::vector<ScaleRun> runs;
};

std::string series_name(const ScaleRun& run) {
  return fmt::format("{}, {} core{} a rank", grid_name(run.grid), run.threads, run.threads == 1 ? "" : "s");
}

std::vector<Series> series_of(const ScaleReport& report) {
  std::vector<Series> all;
  for (const ScaleRun& run : report.runs) {
    const std::string name = series_name(run);
    auto found = std::ranges::find(all, name, &Series::name);
    if (found == all.end()) found = all.insert(found, Series{name, {}});
    found->runs.push_back(run);
  }
  for (Series& series : all) std::ranges::stable_sort(series.runs, {}, &ScaleRun::ranks);
  return all;
}

struct Scales {
  LogScale cores;
  LogScale speed_up;

  [[nodiscard]] Point at(const ScaleReport& report, const ScaleRun& run) const {
    return {cores.at(cores_of(run)), speed_up.at(figures_of(report, run).speed_up)};
  }
};

}  // namespace

std::vector<ScaleRun> measure_scale(Communicator& comm, const Globals& globals, const ScaleInput& input, int frames) {
  HPR_CHECK(frames > 0);
  Session session(comm, globals.session(), [&] { return load_scene(input.scene, input.settings, globals); });
  const std::vector<std::string> hosts = all_gather_texts(comm, session.host());
  std::vector<ScaleRun> runs;
  for (const Size grid : input.grids) {
    runs.push_back(WallBench(session, input, grid, hosts).draw(frames));
  }
  if (comm.rank() != 0) runs.clear();
  return runs;
}

const std::vector<Column<ScaleRun>>& scale_job_columns() {
  using Run = ScaleRun;
  static const std::vector<Column<Run>> columns{field<Run>(
                                                    "columns", [](auto& run) -> auto& { return run.grid.width; }),
                                                field<Run>(
                                                    "rows", [](auto& run) -> auto& { return run.grid.height; }),
                                                field<Run>("ranks", &Run::ranks),
                                                field<Run>("threads", &Run::threads),
                                                field<Run>("gpus", &Run::gpus),
                                                field<Run>("hosts", &Run::hosts),
                                                field<Run>("ms", &Run::ms),
                                                field<Run>("rank_ms", &Run::rank_ms),
                                                field<Run>("bytes_sent", &Run::bytes_sent),
                                                field<Run>("frame_xxh64", &Run::frame_xxh64)};
  return columns;
}

void append_frames(std::vector<ScaleRun>& runs, std::vector<ScaleRun> more) {
  if (runs.empty()) {
    runs = std::move(more);
    return;
  }
  HPR_CHECK(runs.size() == more.size());
  for (std::size_t i = 0; i < runs.size(); ++i) {
    runs[i].ms.insert(runs[i].ms.end(), more[i].ms.begin(), more[i].ms.end());
    // The median of jobs' medians would need all of them; the quickest job was disturbed least.
    std::ranges::transform(runs[i].rank_ms, more[i].rank_ms, runs[i].rank_ms.begin(),
                           [](double a, double b) { return std::min(a, b); });
    if (runs[i].frame_xxh64 != more[i].frame_xxh64) runs[i].frame_xxh64 = kDiffering;
  }
}

bool ScaleReport::oversubscribed(const ScaleRun& run) const {
  return cores_of(run) > machine.cores * run.hosts;
}

ScaleFigures figures_of(const ScaleReport& report, const ScaleRun& run) {
  HPR_CHECK(!run.ms.empty());
  const ScaleRun& base = base_of(report, run);
  ScaleFigures figures;
  figures.median_ms = median(run.ms);
  std::tie(figures.low_ms, figures.high_ms) = median_interval(run.ms);
  if (figures.median_ms > 0.0) figures.speed_up = median(base.ms) / figures.median_ms;
  figures.efficiency = figures.speed_up * cores_of(base) / cores_of(run);
  const double mean = mean_of(run.rank_ms);
  if (mean > 0.0) figures.imbalance = std::ranges::max(run.rank_ms) / mean;
  return figures;
}

std::vector<std::string> slow_ranks(const ScaleReport& report) {
  constexpr double kSlow = 1.5;
  std::vector<std::string> sentences;
  for (const ScaleRun& run : report.runs) {
    const double usual = median(run.rank_ms);
    for (std::size_t rank = 0; rank < run.rank_ms.size() && run.ranks > 2; ++rank) {
      if (run.rank_ms[rank] <= kSlow * usual) continue;
      sentences.push_back(
          fmt::format("rank {} of {} with {} cores was busy for {:.1f} ms of a frame of {}, the middle one for {:.1f}",
                      rank, run.ranks, run.threads, run.rank_ms[rank], grid_name(run.grid), usual));
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
  return fmt::format("{}, screens of {}x{}, seed {}, {} frames each; {}, {} cores, {}\n", report.input,
                     report.size.width, report.size.height, report.seed, report.runs.front().ms.size(),
                     report.machine.cpu, report.machine.cores, report.machine.mpi) +
         Table(report_columns(report), std::span(report.runs))
             .text({"tiles", "threads", "ranks", "gpus", "hosts", "median", "interval", "speed_up", "percent",
                    "imbalance", "bytes_sent", "frame", "note"});
}

std::string scale_json(const ScaleReport& report) {
  const Json json{{"schema", "hpr.bench-scale/1"},
                  {"command", report.command},
                  {"commit", std::string(kCommit)},
                  {"machine", machine_json(report.machine)},
                  {"input", report.input},
                  {"screen", {{"width", report.size.width}, {"height", report.size.height}}},
                  {"seed", report.seed},
                  {"pictures_agree", pictures_agree(report)},
                  {"runs", Table(report_columns(report), std::span(report.runs)).json()}};
  return json.dump(2) + "\n";
}

std::string scale_csv(const ScaleReport& report) {
  struct FrameRow {
    const ScaleRun* run;
    std::size_t frame;
  };
  std::vector<FrameRow> frames;
  for (const ScaleRun& run : report.runs) {
    for (std::size_t frame = 0; frame < run.ms.size(); ++frame) frames.push_back({&run, frame});
  }
  const std::vector<Column<FrameRow>> columns{
      {"tiles", [](const FrameRow& row) { return Json(grid_name(row.run->grid)); }},
      {"threads", [](const FrameRow& row) { return Json(row.run->threads); }},
      {"ranks", [](const FrameRow& row) { return Json(row.run->ranks); }},
      {"hosts", [](const FrameRow& row) { return Json(row.run->hosts); }},
      {"frame", [](const FrameRow& row) { return Json(row.frame); }},
      {"ms", [](const FrameRow& row) { return Json(row.run->ms[row.frame]); }, {.csv_format = "{:.6f}"}}};
  return Table(columns, std::span<const FrameRow>(frames)).csv();
}

std::string plot_speed_up(const ScaleReport& report) {
  Plot plot(kField, "Speed-up over the cores of all ranks", "The table has all figures.");
  std::set<int> cores;
  std::vector<double> speed_ups;
  for (const ScaleRun& run : report.runs) {
    cores.insert(cores_of(run));
    speed_ups.push_back(figures_of(report, run).speed_up);
  }
  const double linear = static_cast<double>(*cores.rbegin()) / *cores.begin();
  speed_ups.push_back(linear);
  const Scales scales{LogScale::of({cores.begin(), cores.end()}, kField.left + 30, kField.right - 30),
                      LogScale::of(std::move(speed_ups), kField.bottom, kField.top)};
  std::vector<Tick> ticks;
  ticks.reserve(cores.size());
  for (const int count : cores) ticks.push_back({scales.cores.at(count), fmt::format("{}", count)});
  plot.draw_y_ticks(scales.speed_up.ticks());
  plot.draw_x_ticks(ticks);
  plot.name_y_axis("speed-up");
  plot.name_x_axis("cores of all ranks");
  plot.draw_axis_lines();
  SvgCanvas& canvas = plot.canvas();
  canvas.line({scales.cores.at(*cores.begin()), scales.speed_up.at(1.0)},
              {scales.cores.at(*cores.rbegin()), scales.speed_up.at(linear)}, {"#888888", 1.2, "2 4"});
  canvas.text({kField.right + 26, kField.top + 10}, "dotted: linear");

  const std::vector<Series> all = series_of(report);
  for (std::size_t i = 0; i < all.size(); ++i) {
    const SeriesStyle& style = series_style(i);
    std::vector<Point> points;
    for (const ScaleRun& run : all[i].runs) {
      const Point at = scales.at(report, run);
      points.push_back(at);
      canvas.circle(at, 4.6, style.color, {style.color, 0.5});
    }
    canvas.polyline(points, {style.color, 1.8, style.dashes});
    const double y = kField.top + 32.0 + 18.0 * static_cast<double>(i);
    canvas.line({kField.right + 2, y}, {kField.right + 20, y}, {style.color, 1.8, style.dashes});
    canvas.text({kField.right + 26, y + 4}, all[i].name);
  }
  return plot.str();
}

std::string scale_html(const ScaleReport& report) {
  std::string page =
      html_heading("Scaling with ranks and cores",
                   std::array{Fact{"Input", fmt::format("{}, seed {}", report.input, report.seed)},
                              Fact{"Screens", fmt::format("of {}x{} pixels", report.size.width, report.size.height)},
                              Fact{"Machine", report.machine.cpu},
                              Fact{"Cores", fmt::format("{}", report.machine.cores)}, Fact{"MPI", report.machine.mpi},
                              Fact{"Frames", fmt::format("{} per run", report.runs.front().ms.size())},
                              Fact{"Commit", std::string(kCommit)}, Fact{"Command", report.command, true}});
  const auto crowded = [&](const ScaleRun& run) { return report.oversubscribed(run); };
  if (std::ranges::any_of(report.runs, crowded)) {
    page += "<p class=\"warning\">Some runs have more threads than the machine has cores.</p>\n";
  }
  for (const std::string& sentence : slow_ranks(report)) {
    page += fmt::format("<p class=\"warning\">{}</p>\n", escape_markup(sentence));
  }
  if (!pictures_agree(report)) page += "<p class=\"warning\">Not all runs of a wall made the same picture.</p>\n";
  page += html_figure(plot_speed_up(report), "Medians against the least cores of the same wall.");
  page += "<h2>All runs</h2>\n" +
          Table(report_columns(report), std::span(report.runs))
              .html({"tiles", "threads", "ranks", "gpus", "hosts", "median", "low", "high", "speed_up", "percent",
                     "imbalance", "bytes_sent", "frame"},
                    {.caption = "Milliseconds of a frame on the slowest rank, from its first triangle to its last tile "
                                "on a screen. Speed-up and efficiency are against the least cores of the same wall; "
                                "imbalance is the busiest rank by the mean."});
  return html_page(fmt::format("hpr bench scale: {}", report.input), page);
}

}  // namespace hpr
