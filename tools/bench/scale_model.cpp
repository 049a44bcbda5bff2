#include "tools/bench/scale_model.h"

#include <fmt/format.h>
#include <hpr/version.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/constants.hpp>
#include <numeric>

#include "cluster/transport/local_communicator.h"
#include "core/json.h"
#include "core/progress.h"
#include "core/text.h"
#include "core/timing.h"
#include "engine/balance/distribution_choice.h"
#include "engine/balance/load_balance.h"
#include "engine/display/exposure.h"
#include "engine/frame_maker.h"
#include "engine/output.h"
#include "engine/session.h"
#include "engine/wall/wall_displays.h"
#include "image/color.h"
#include "image/key.h"
#include "rt/deferred_shader.h"
#include "tools/report/canvas.h"
#include "tools/report/plot.h"
#include "tools/simulated_cluster.h"
#include "tools/sweep.h"
#include "walls/config/wall_file.h"
#include "walls/geometry/geometry.h"

namespace hpr {
namespace {

constexpr double kNsPerSecond = 1e9;
constexpr double kNsPerMs = 1e6;

double sum_of(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

/// The camera, or so many about the scene, a little higher one by one, that look at its middle.
std::vector<Camera> cameras_about(const Scene& scene, const RenderSettings& settings, int sides) {
  const Camera chosen = choose_camera(settings.camera, scene);
  if (sides == 0) return {chosen};
  const glm::dvec3 center = 0.5 * (scene.bounds.low + scene.bounds.high);
  const double extent = glm::length(scene.bounds.high - scene.bounds.low);
  constexpr double kFieldOfView = 0.8;
  std::vector<Camera> cameras;
  cameras.reserve(static_cast<std::size_t>(sides));
  for (int side = 0; side < sides; ++side) {
    const double angle = glm::two_pi<double>() * side / sides;
    const glm::dvec3 direction(std::cos(angle), 0.25 + 0.6 * side / sides, std::sin(angle));
    cameras.push_back(
        look_at(center + 0.75 * extent * glm::normalize(direction), center, {0.0, 1.0, 0.0}, kFieldOfView));
  }
  return cameras;
}

/// What one view's frame takes a rank alone.
struct MeasuredFrame {
  FrameLoad load;
  double ray_ns = 0.0;     ///< of a pixel
  double finish_ns = 0.0;  ///< of a pixel
  double pixels = 0.0;
};

/// Draws frames of a view on one rank, of which the last one counts.
MeasuredFrame measure_frame(Session& session, const ScaleInput& input, std::span<const View> screens,
                            const MachineSpeeds& speeds) {
  FrameMaker maker(session, input.settings.frame, input.settings.sampling, screens, {}, {}, true);
  prepare(session, maker.plan());
  const DisplaySettings& display = input.settings.display;
  Showing showing;
  showing.shown_by.assign(screens.size(), 0);
  for (const View& screen : screens) showing.sizes.push_back(screen.screen);
  double rest_ms = 0.0;
  Progress silent("none", "sample", 0);
  for (int number = 0; number <= input.warmup; ++number) {
    session.shader(maker.plan().rays).discard_photons();
    const Stopwatch watch;
    Frame& frame = *maker.make(screens, 0, silent);
    showing.transform = transform_for(session, frame, maker.blocks().views, display);
    (void)bring_to_screens(session, frame, maker.blocks(), showing);
    const FrameTimes& times = maker.times();
    rest_ms = std::max(watch.ms() - times.primary_ms - times.light_ms, 0.0);
  }
  const FramePlan& plan = maker.plan();
  const FrameTimes& times = maker.times();
  const double samples = std::max(times.samples, 1);
  MeasuredFrame measured{load_of_frame(session, plan, speeds, maker.blocks().views), 0.0, 0.0, 0.0};
  double& pixels = measured.pixels;
  for (const View& view : maker.blocks().views) pixels += static_cast<double>(view.size().area());
  // Photons, which no tile has, are shared out evenly too.
  const double light = sum_of(measured.load.light_ns);
  HPR_CHECK(measured.load.light_ns.size() == measured.load.layout.tiles());
  for (double& ns : measured.load.light_ns) ns *= light > 0.0 ? kNsPerMs * times.light_ms / samples / light : 0.0;
  measured.ray_ns = kNsPerMs * times.primary_ms / samples / pixels;
  measured.finish_ns = kNsPerMs * rest_ms / samples / pixels;
  return measured;
}

/// Models a wall on so many ranks, by the mean of its views.
ModelledScale model_one(Distribution distribution, const std::vector<MeasuredFrame>& frames,
                        const ScaleModelReport& report, int ranks, int groups) {
  ModelledScale modelled;
  modelled.ranks = ranks;
  modelled.hosts =
      std::min(report.cluster.hosts, (ranks + report.cluster.ranks_per_host() - 1) / report.cluster.ranks_per_host());
  FramePrediction& mean = modelled.frame;
  FramePrediction alone;
  mean.distribution = distribution;
  mean.imbalance = mean.overlap = 0.0;
  const double part = 1.0 / static_cast<double>(frames.size());
  for (const MeasuredFrame& frame : frames) {
    const auto predict = [&](Distribution by, int count) {
      MachineSpeeds speeds = speeds_on(report.cluster, report.measured, count);
      speeds.ray = frame.ray_ns;
      speeds.finish = frame.finish_ns;
      FrameLoad load = frame.load;
      const auto screens = static_cast<int>(load.layout.screens());
      load.writers = std::min({screens, modelled.hosts, count});
      return predict_frame(by, load, speeds, count, groups);
    };
    const FramePrediction made = predict(distribution, ranks);
    const FramePrediction one = predict(Distribution::SortFirst, 1);
    for (const FramePhase& phase : kFramePhases) {
      mean.*phase.ms += part * made.*phase.ms;
      alone.*phase.ms += part * one.*phase.ms;
    }
    mean.imbalance += part * made.imbalance;
    mean.overlap += part * made.overlap;
  }
  modelled.speed_up = mean.total_ms() > 0.0 ? alone.total_ms() / mean.total_ms() : 1.0;
  modelled.limit = limit_of(alone, mean, ranks);
  return modelled;
}

/// Of a wall's views.
void note_means(const std::vector<MeasuredFrame>& frames, MachineSpeeds& speeds) {
  speeds.ray = speeds.finish = speeds.light = 0.0;
  for (const MeasuredFrame& frame : frames) {
    const double part = 1.0 / static_cast<double>(frames.size());
    speeds.ray += part * frame.ray_ns;
    speeds.finish += part * frame.finish_ns;
    speeds.light += part * sum_of(frame.load.light_ns) / frame.pixels;
  }
}

Json speeds_json(const ScaleModelReport& report) {
  const MachineSpeeds& speeds = report.measured;
  return {{"keys", report.by_rays ? "rays" : "raster"},
          {"triangle_ns", speeds.raster.triangle},
          {"pixel_ns", speeds.raster.pixel},
          {"read_ns", speeds.raster.read},
          {"draw_ns", speeds.raster.draw},
          {"ray_ns", speeds.ray},
          {"light_ns", speeds.light},
          {"finish_ns", speeds.finish},
          {"chunk_ns", speeds.chunk},
          {"group_ns", speeds.group}};
}

std::string facts_of(const ScaleModelReport& report) {
  const SimulatedCluster& cluster = report.cluster;
  const MachineSpeeds& speeds = report.measured;
  const std::string keys = report.by_rays
                               ? fmt::format("a ray {:.3g} ns", speeds.ray)
                               : fmt::format("a triangle {:.3g} ns, a pixel {:.2g} ns and {:.2g} to read",
                                             speeds.raster.triangle, speeds.raster.pixel, speeds.raster.read);
  return fmt::format(
      "simulated: {} hosts, {} ranks of a core each; a message {:.3g} us and {:.3g} of a core at both ends, {:.3g} "
      "GB/s "
      "a rank, merging {:.3g} GB/s; work as measured on {}: {}, light of a pixel {:.3g} ns, to finish it {:.3g}",
      cluster.hosts, cluster.ranks, 1e6 * cluster.latency, 1e6 * cluster.overhead, 1e-9 * cluster.bandwidth,
      1e-9 * cluster.merge, report.machine.cpu, keys, speeds.light, speeds.finish);
}

using Run = ModelledScale;

Column<Run> phase_column(const char* key, double FramePrediction::*member, const char* title) {
  return {key,
          [member](const Run& run) { return Json(run.frame.*member); },
          {.title = title, .format = "{:.2f}", .html_format = "{:.2f}", .csv_format = "{:.6f}", .width = 9}};
}

const std::vector<Column<Run>>& model_columns() {
  static const std::vector<Column<Run>> columns{
      {"tiles",
       [](const Run& run) { return Json(grid_name(run.grid)); },
       {.title = "tiles", .align = Align::Left, .width = 7}},
      field<Run>("ranks", &Run::ranks, {.title = "ranks", .width = 5}),
      field<Run>("hosts", &Run::hosts, {.title = "hosts", .width = 5}),
      {"distribution",
       [](const Run& run) { return Json(name_of(run.frame.distribution)); },
       {.title = "distribution", .align = Align::Left, .width = 12, .gap = 2}},
      {"ms",
       [](const Run& run) { return Json(run.frame.total_ms()); },
       {.title = "ms", .format = "{:.2f}", .html_format = "{:.2f}", .csv_format = "{:.6f}", .width = 9}},
      phase_column("ms_draw", &FramePrediction::draw_ms, "draw"),
      phase_column("ms_composite", &FramePrediction::composite_ms, "composite"),
      phase_column("ms_light", &FramePrediction::light_ms, "light"),
      phase_column("ms_prepare", &FramePrediction::prepare_ms, "prepare"),
      phase_column("ms_show", &FramePrediction::show_ms, "show"),
      field<Run>("speed_up", &Run::speed_up, {.title = "speed-up", .format = "{:.2f}", .width = 8}),
      {"efficiency",
       [](const Run& run) { return Json(run.efficiency()); },
       {.title = "efficiency", .format = "{:.0f} %", .scale = 100.0, .width = 10}},
      {"imbalance",
       [](const Run& run) { return Json(run.frame.imbalance); },
       {.title = "imbalance", .format = "{:.2f}", .width = 9}},
      {"overlap",
       [](const Run& run) { return Json(run.frame.overlap); },
       {.title = "overlap", .format = "{:.2f}", .width = 7}},
      {"limit",
       [](const Run& run) { return run.limit.part > 0.0 ? Json(run.limit.phase->name) : Json(); },
       {.title = "what limits", .align = Align::Left, .gap = 2}},
      {"limit_part",
       [](const Run& run) { return Json(run.limit.part); },
       {.title = "of the frame", .format = "{:.0f} %", .scale = 100.0, .width = 6}}};
  return columns;
}

const std::vector<std::string> kModelColumns{"tiles",    "ranks",        "hosts",    "distribution", "ms",
                                             "ms_draw",  "ms_composite", "ms_light", "ms_prepare",   "ms_show",
                                             "speed_up", "efficiency",   "overlap",  "limit",        "limit_part"};

constexpr PlotLayout kField{.right = 700.0};

std::string plot_efficiency(const ScaleModelReport& report, Size grid) {
  Plot plot(kField, fmt::format("Efficiency over ranks, {}", grid_name(grid)), "The table has all figures.");
  const LogScale ranks =
      LogScale::of({1.0, static_cast<double>(report.cluster.ranks)}, kField.left + 30, kField.right - 30);
  const auto y_of = [](double efficiency) {
    return kField.bottom + (kField.top - kField.bottom) * std::clamp(efficiency, 0.0, 1.1) / 1.1;
  };
  std::vector<Tick> percents;
  for (int percent = 0; percent <= 100; percent += 20) {
    percents.push_back({y_of(percent / 100.0), fmt::format("{} %", percent)});
  }
  std::vector<Tick> counts;
  for (const int count : powers_of_two_up_to(report.cluster.ranks))
    counts.push_back({ranks.at(count), fmt::format("{}", count)});
  plot.draw_y_ticks(percents);
  plot.draw_x_ticks(counts);
  plot.name_y_axis("efficiency");
  plot.name_x_axis("ranks (simulated)");
  plot.draw_axis_lines();
  SvgCanvas& canvas = plot.canvas();
  for (std::size_t i = 0; i < kDistributions.size(); ++i) {
    const SeriesStyle& style = series_style(i);
    std::vector<Point> points;
    for (const Run& run : report.runs) {
      if (run.grid != grid || run.frame.distribution != kDistributions[i]) continue;
      points.push_back({ranks.at(run.ranks), y_of(run.efficiency())});
      canvas.circle(points.back(), 4.0, style.color, {style.color, 0.5});
    }
    canvas.polyline(points, {style.color, 1.8, style.dashes});
    const double y = kField.top + 14.0 + 18.0 * static_cast<double>(i);
    canvas.line({kField.right + 2, y}, {kField.right + 20, y}, {style.color, 1.8, style.dashes});
    canvas.text({kField.right + 26, y + 4}, name_of(kDistributions[i]));
  }
  return plot.str();
}

}  // namespace

MachineSpeeds speeds_on(const SimulatedCluster& cluster, const MachineSpeeds& measured, int ranks) {
  MachineSpeeds speeds = measured;
  const bool is_local = ranks <= cluster.ranks_per_host();
  const double latency = is_local ? cluster.local_latency : cluster.latency;
  const double bandwidth = is_local ? cluster.local_bandwidth : cluster.bandwidth;
  speeds.message = kNsPerSecond * (latency + 2.0 * cluster.overhead);
  speeds.post = kNsPerSecond * 2.0 * cluster.overhead;
  speeds.merge = kNsPerSecond * sizeof(Key) * (1.0 / bandwidth + 1.0 / cluster.merge);
  speeds.merge_in_place = kNsPerSecond * sizeof(Key) / cluster.merge;
  // Of its host's link, to one of the ranks there.
  const double to_screen = is_local ? bandwidth : bandwidth * cluster.ranks_per_host();
  speeds.collect = kNsPerSecond * sizeof(Rgba8) / to_screen;
  speeds.host_ranks = std::min(cluster.ranks_per_host(), ranks);
  return speeds;
}

ScaleModelReport model_scale(const Globals& globals, const ScaleInput& input, const SimulatedCluster& cluster,
                             int sides) {
  ScaleModelReport report{
      "hpr " + shell_line(globals.args), this_machine(), input.scene, input.size, sides, cluster, {}, false, {}};
  run_local_ranks(1, [&](Communicator& comm) {
    SessionSettings one_core = globals.session();
    one_core.threads = 1;
    Session session(comm, one_core, [&] { return load_scene(input.scene, input.settings, globals, input.size); });
    report.by_rays = input.settings.frame.primary == Primary::Rays;
    if (!report.by_rays) {
      session.start_gl();
      report.measured.raster = session.measure_raster();
    }
    const FrameSettings& settings = input.settings.frame;
    for (const Size grid : input.grids) {
      const Wall wall = load_wall(wall_of(grid, input.size));
      std::vector<MeasuredFrame> frames;
      for (const Camera& camera : cameras_about(session.scene(), input.settings, sides)) {
        frames.push_back(
            measure_frame(session, input, wall_views(wall, camera, session.scene().bounds), report.measured));
      }
      if (grid == input.grids.front()) note_means(frames, report.measured);
      for (const int ranks : powers_of_two_up_to(cluster.ranks)) {
        for (const Distribution distribution : kDistributions) {
          report.runs.push_back(model_one(distribution, frames, report, ranks, settings.groups));
          report.runs.back().grid = grid;
        }
      }
    }
  });
  return report;
}

std::string scale_model_table(const ScaleModelReport& report) {
  return fmt::format("{}, screens of {}x{}, {}; {}\n", report.input, report.size.width, report.size.height,
                     report.sides == 0 ? std::string("as the camera sees it")
                                       : fmt::format("the mean of {} sides", report.sides),
                     facts_of(report)) +
         Table(model_columns(), std::span(report.runs)).text(kModelColumns);
}

std::string scale_model_json(const ScaleModelReport& report) {
  const Json json{{"schema", "hpr.bench-scale-model/1"},
                  {"command", report.command},
                  {"commit", std::string(kCommit)},
                  {"machine", machine_json(report.machine)},
                  {"input", report.input},
                  {"screen", {{"width", report.size.width}, {"height", report.size.height}}},
                  {"sides", report.sides},
                  {"simulated", cluster_json(report.cluster)},
                  {"measured", speeds_json(report)},
                  {"runs", Table(model_columns(), std::span(report.runs)).json()}};
  return json.dump(2) + "\n";
}

std::string scale_model_csv(const ScaleModelReport& report) {
  return Table(model_columns(), std::span(report.runs)).csv();
}

std::string scale_model_html(const ScaleModelReport& report) {
  std::string page =
      html_heading("Scaling on a simulated cluster",
                   std::array{Fact{"Input", report.input},
                              Fact{"Screens", fmt::format("of {}x{} pixels", report.size.width, report.size.height)},
                              Fact{"Model", facts_of(report)}, Fact{"Commit", std::string(kCommit)},
                              Fact{"Command", report.command, true}});
  page +=
      "<p class=\"warning\">No frame was drawn on such a cluster: work is measured on one core of this machine, links "
      "are modelled.</p>\n";
  std::vector<Size> grids;
  for (const Run& run : report.runs) {
    if (std::ranges::find(grids, run.grid) == grids.end()) grids.push_back(run.grid);
  }
  for (const Size grid : grids) {
    page += html_figure(plot_efficiency(report, grid), "Speed-up against one rank, by the ranks.");
  }
  page +=
      "<h2>All runs</h2>\n" +
      Table(model_columns(), std::span(report.runs))
          .html(kModelColumns, {.caption = "Milliseconds of a sample, each phase of its slowest rank. What limits is "
                                           "the phase that loses most against an even part of what it takes one "
                                           "rank, and how much of the frame that is."});
  return html_page(fmt::format("hpr bench scale: {}, simulated", report.input), page);
}

}  // namespace hpr
