#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <map>

#include "app/command.h"
#include "app/doctor/doctor.h"
#include "app/options/render_options.h"
#include "cluster/transport/local_communicator.h"
#include "core/error.h"
#include "core/log.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "core/timing.h"
#include "engine/checkpoint/checkpoint.h"
#include "engine/frame_sampler.h"
#include "engine/output.h"
#include "engine/session.h"
#include "rt/deferred_shader.h"
#include "rt/passes/pass_list.h"
#include "tools/bench/bench.h"
#include "tools/bench/bench_device.h"
#include "tools/bench/bench_raster.h"
#include "tools/bench/bench_rays.h"
#include "tools/sweep.h"

namespace hpr {
namespace {

constexpr Size kRayPicture{512, 512};
/// The bare loop has them all in one buffer, instances written out.
constexpr std::uint32_t kMaxBareTriangles = 30'000'000;

/// What one frame took.
struct Measured {
  FrameTimes times;
  double screen_ms = 0.0;
  double frame_ms = 0.0;
  double processor_ms = 0.0;  ///< of all threads
  double serial_ms = 0.0;     ///< of one thread alone
  double even_ms = 0.0;       ///< see LoopProfile
  double scheduled_ms = 0.0;
};

/// The median of what `of` takes out of each frame.
template <typename Of>
double median_of(const std::vector<Measured>& frames, const Of& of) {
  std::vector<double> values;
  values.reserve(frames.size());
  for (const Measured& frame : frames) values.push_back(of(frame));
  return median(std::move(values));
}

/// All visible triangles in world space, as one mesh.
struct WorldMesh {
  std::vector<glm::vec3> positions;
  std::vector<glm::uvec3> triangles;

  explicit WorldMesh(const Scene& scene) {
    for (const Instance& instance : scene.instances) {
      const Mesh& mesh = scene.mesh_of(instance);
      const auto first = static_cast<std::uint32_t>(positions.size());
      for (const glm::vec3& position : mesh.positions) {
        positions.emplace_back(instance.to_world * glm::dvec4(position, 1.0));
      }
      for (const glm::uvec3& triangle : mesh.triangles) triangles.push_back(triangle + first);
    }
  }
};

double bare_gl_ms(const Globals& globals, int threads, const WorldMesh& mesh, const View& view, int frames) {
  const auto context = make_gl_context(gl_options(globals, threads));
  BareGl bare(*context, mesh.positions, mesh.triangles, glm::mat4(clip_from_world(view, {0.0, 0.0, 0.0})), view.size(),
              fastest_route(*context));
  // Two frames to warm up: shaders are compiled at the first draw.
  const double ms = median_times({[&] { (void)bare.frame(); }}, {2, frames}).front();
  check_gl(context->gl(), "measuring");
  return ms;
}

double copy_ms(std::size_t bytes) {
  const std::vector<std::byte> from(bytes, std::byte{1});
  std::vector<std::byte> into(bytes);
  return median_times({[&] { std::memcpy(into.data(), from.data(), bytes); }}, {0, 9}).front();
}

BenchRow row_of(std::string name, double ours, double floor) {
  return {std::move(name), ours, floor, "ms", ours > 0.0 ? floor / ours : 0.0};
}

double ms_of(const FrameTimes& times, std::string_view pass) {
  const auto found = std::ranges::find(times.passes, pass, &PassTime::name);
  return found == times.passes.end() ? 0.0 : found->ms;
}

/// A frame, drawn again and again, and the floors of its steps.
class Bench {
 public:
  /// `settings` are resolved.
  Bench(Session& session, const RenderSettings& settings, Size size)
      : session_(session), sampling_(settings.sampling), transform_(fixed_transform(settings.display)) {
    const Scene& scene = session.scene();
    camera_ = choose_camera(settings.camera, scene);
    view_ = make_view(camera_, size, scene.bounds);
    blocks_ = cut_blocks(std::span(&view_, 1), settings.frame.resolution_scale);
    HPR_CHECK(blocks_.views.size() == 1);
    plan_ = plan_frame(session, settings.frame, blocks_.views);
    prepare(session, plan_);
  }

  void draw(int frames) {
    Progress silent("none", "sample", 0);
    measure_in_turns(1, {1, frames}, [&](std::size_t /*contender*/, bool counts) {
      session_.shader(plan_.rays).discard_photons();  // of the same sample, in the frame before
      LoopProfile profile;
      const Stopwatch watch;
      FrameSampler sampler(session_, plan_, sampling_, 0, false);
      (void)sampler.draw(blocks_.views, {}, silent);  // it stops before its goal for a checkpoint only
      const double drawn = watch.ms();
      (void)bring_to_screens(session_, sampler.frame(), blocks_, {{view_.screen}, {0}, transform_});
      const double ms = watch.ms();
      profile.finish();
      const int threads = session_.threads();
      if (!counts) return;
      frames_.push_back({sampler.times(), ms - drawn, ms, profile.all_ms(), profile.serial_ms(),
                         profile.even_ms(threads), profile.scheduled_ms(threads)});
      for (const auto& [phase, alone_ms] : profile.serial_phases())
        log::debug("{:.2f} ms of one thread alone up to a loop of '{}'", alone_ms, phase);
    });
  }

  /// `bare_keys_ms`: of BareGl, where keys are not made by rays; 0: it was not measured.
  [[nodiscard]] std::vector<BenchRow> rows(double bare_keys_ms) {
    const auto rates = embree_rates();
    const double samples = frames_.front().times.samples;
    const auto pixels = static_cast<double>(drawn_view().size().area());
    std::vector<BenchRow> rows{keys_row(by_rays() ? pixels / rate_of(rates, RayPattern::Primary) : bare_keys_ms)};
    for (const PassTime& pass : frames_.front().times.passes) rows.push_back(pass_row(pass, rates));
    rows.push_back(row_of("to the screen", median_of(frames_, [](const Measured& frame) { return frame.screen_ms; }),
                          copy_ms(view_.screen.area() * sizeof(Rgba8))));
    double floor = 0.0;
    for (const BenchRow& row : rows) floor += row.floor;
    rows.push_back(row_of(fmt::format("the frame, {}x{}, {:g} sample{}", view_.screen.width, view_.screen.height,
                                      samples, samples == 1.0 ? "" : "s"),
                          median_of(frames_, [](const Measured& frame) { return frame.frame_ms; }), floor));
    add_spread(rows);
    return rows;
  }

  [[nodiscard]] const View& drawn_view() const { return blocks_.views.front(); }
  [[nodiscard]] bool by_rays() const { return plan_.primary == Primary::Rays; }

 private:
  using Rates = std::map<std::string, double, std::less<>>;

  /// Rays of bare Embree per ms of all threads, by their kind.
  [[nodiscard]] Rates embree_rates() {
    Rates rates;
    const Scene& scene = session_.scene();
    const View rays = make_view(camera_, kRayPicture, scene.bounds);
    for (const BenchRow& row : bench_rays(scene, session_.ray_scene(plan_.rays.build), rays)) {
      rates[row.name] = row.floor * 1e3 * session_.threads();
    }
    return rates;
  }

  /// 0 where no such rays were measured.
  [[nodiscard]] static double rate_of(const Rates& rates, RayPattern pattern) {
    const auto found = rates.find(name_of(pattern));
    return found == rates.end() ? 0.0 : found->second;
  }

  /// How the frame's work spreads over threads, as LoopProfile has it; the floors are all of its processor time by as
  /// many threads. One thread shares with nobody.
  void add_spread(std::vector<BenchRow>& rows) const {
    const int threads = session_.threads();
    const double all = median_of(frames_, [](const Measured& frame) { return frame.processor_ms; });
    rows.push_back(row_of("processor time", all, 0.0));
    if (threads < 2) return;
    const auto add = [&](std::string name, double Measured::*value, double floor) {
      rows.push_back(
          row_of(std::move(name), median_of(frames_, [&](const Measured& frame) { return frame.*value; }), floor));
    };
    add("of one thread alone", &Measured::serial_ms, 0.0);
    add(fmt::format("{} threads, loops shared evenly", threads), &Measured::even_ms, all / threads);
    add(fmt::format("{} threads, loops as they are", threads), &Measured::scheduled_ms, all / threads);
  }

  [[nodiscard]] BenchRow keys_row(double floor_ms_of_sample) const {
    return row_of(fmt::format("keys of {} triangles{}", session_.scene().triangles,
                              plan_.keys_on_device ? " by rays of the device"
                              : by_rays()          ? " by rays"
                                                   : ""),
                  median_of(frames_, [](const Measured& frame) { return frame.times.primary_ms; }),
                  floor_ms_of_sample * frames_.front().times.samples);
  }

  [[nodiscard]] BenchRow pass_row(const PassTime& step, const Rates& rates) const {
    const double ours =
        median_of(frames_, [&](const Measured& frame) { return ms_of(frame.times, step.name) / session_.threads(); });
    if (!step.pass) return row_of(step.name, ours, 0.0);
    const auto rays = static_cast<double>(frames_.front().times.rays[*step.pass]);
    const double rate = rate_of(rates, info_of(*step.pass).pattern);
    if (rays == 0.0 || rate == 0.0) return row_of(step.name, ours, 0.0);
    return row_of(fmt::format("{}: {:.3g} M rays", step.name, rays / 1e6), ours, rays / rate);
  }

  Session& session_;
  Sampling sampling_;
  DisplayTransform transform_;
  Camera camera_;
  View view_;
  Blocks blocks_;
  FramePlan plan_;
  std::vector<Measured> frames_;
};

/// `hpr bench frame`: a whole frame of one rank, step by step, beside what bare libraries need for as much.
class BenchFrameCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "frame"; }
  [[nodiscard]] std::string_view summary() const override {
    return "a whole frame of one rank, step by step, against bare GL, bare Embree and a copy";
  }

  void declare(const OptionSet& options) override {
    options.option("scene", scene_, "what is drawn").show_default().type("SCENE");
    options.option("--size", size_, "pixels of the frame").show_default().type("WxH");
    options.option("--reps", frames_, "measured frames").range(1, 10'000).show_default();
    (void)declare_settings(options, settings_, SettingScope::Pictures);
    options.flag("--json", json_, "one JSON document");
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    print_bench(measure(globals), this_machine().cpu, json_);
    return ExitCode::Done;
  }

 private:
  /// Rows in ms of all threads together. Keys: against BareGl with the same triangles, or bare Embree's primary rays
  /// where rays make them. A pass: against bare Embree tracing as many rays of its kind, on the same scene. To the
  /// screen: against a copy of the picture's bytes. The frame: against the sum of these floors; shading and what else
  /// has none lowers the ratio.
  [[nodiscard]] std::vector<BenchRow> measure(const Globals& globals) const {
    const Size size = parse_size(size_, "--size", kRasterLimit);
    check_size(size, globals.picture_limits());
    const RenderSettings settings = resolve(settings_, globals.seed);
    if (!settings.sampling.goal.samples) {
      throw Error(ExitCode::Usage, "bench frame draws the same frame again and again: --spp takes a number here",
                  "write e.g. --spp 16");
    }
    if (globals.ranks > 1) {
      throw Error(ExitCode::Usage, "bench frame draws on one rank", "leave --ranks out, or see hpr bench scale");
    }
    std::vector<BenchRow> rows;
    run_local_ranks(1, [&](Communicator& comm) {
      Session session(comm, globals.session(), [&] { return load_scene(scene_, settings, globals, size); });
      Bench bench(session, settings, size);
      bench.draw(frames_);
      const bool draws = !bench.by_rays() && session.scene().triangles <= kMaxBareTriangles;
      rows = bench.rows(
          draws ? bare_gl_ms(globals, session.threads(), WorldMesh(session.scene()), bench.drawn_view(), frames_)
                : 0.0);
    });
    return rows;
  }

  std::string scene_ = "gen:gallery";
  std::string size_ = "1280x720";
  int frames_ = 5;
  bool json_ = false;
  RenderSettings settings_;
};

}  // namespace

std::unique_ptr<Command> make_bench_frame_command() {
  return std::make_unique<BenchFrameCommand>();
}

}  // namespace hpr
