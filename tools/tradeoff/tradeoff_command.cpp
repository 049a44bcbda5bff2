#include <fmt/format.h>
#include <fmt/ranges.h>
#include <hpr/version.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <optional>
#include <set>

#include "app/command.h"
#include "app/launch/run_ranks.h"
#include "app/options/render_options.h"
#include "cluster/transport/collectives.h"
#include "core/bytes.h"
#include "core/file.h"
#include "core/log.h"
#include "core/signals.h"
#include "core/text.h"
#include "engine/output.h"
#include "engine/session.h"
#include "scene/view.h"
#include "tools/diff/diff.h"
#include "tools/sweep.h"
#include "tools/tradeoff/tradeoff_measure.h"
#include "tools/tradeoff/tradeoff_report.h"

namespace hpr {
namespace {

constexpr int kCropSide = 128;
constexpr double kQuickMs = 200.0;
constexpr std::uint64_t kMaxStateBytes = std::uint64_t{1} << 32U;

/// The options given that a frame of `hpr render` takes as well, in an order and spelling that do not depend on those
/// of the command line; without those that a sweep has of its own or varies, and those that change neither pictures nor
/// times.
std::vector<std::string> base_options(const OptionSet& options, std::span<const std::string> varied) {
  static const std::set<std::string> excluded{"vary",     "metric",       "reference", "reference-spp", "budget",
                                              "frames",   "html",         "csv",       "size",          "json",
                                              "progress", "hang-timeout", "limit-mem", "limit-image",   "trace",
                                              "resume",   "force",        "strict",    "quiet",         "verbose"};
  std::vector<std::string> arguments;
  for (const GivenOption& option : options.specified()) {
    if (excluded.contains(option.name) || std::ranges::find(varied, option.name) != varied.end()) continue;
    const bool is_set_flag = option.is_flag && option.value == "true";
    arguments.push_back(is_set_flag ? "--" + option.name : fmt::format("--{}={}", option.name, option.value));
  }
  return arguments;
}

class TradeoffCommand final : public Command {
 public:
  [[nodiscard]] bool collective() const override { return true; }
  [[nodiscard]] std::string_view name() const override { return "tradeoff"; }
  [[nodiscard]] std::string_view summary() const override {
    return "what the knobs of a scene cost and lose: time against error, and the settings a budget allows";
  }

  void declare(const OptionSet& options) override {
    options_.emplace(options);
    options.option("scene", scene_, "a .gltf or .glb file, or gen:NAME?key=value").required();
    options.option("--vary", vary_, "a knob and its values, spp=1,4,16; again for another knob (see hpr help knobs)")
        .type("K=V,V,...")
        .repeats()
        .required();
    options
        .option("--metric", metrics_,
                "relmse, rmse, psnr, ssim, flip: which errors to measure; the first one decides the front")
        .list();
    options
        .option("--reference", how_.reference,
                "the truth: an .exr or .png, path (path tracing), passes (--quality best, many samples), or auto: "
                "passes where light of points is seen through mirrors and glass, which paths cannot find, else path")
        .type("FILE|auto")
        .show_default();
    options.option("--reference-spp", how_.reference_spp, "samples of a rendered truth")
        .range(std::uint32_t{16}, std::uint32_t{1'000'000'000})
        .show_default();
    options.option("--budget", budget_, "a time (33ms) or an error (flip=0.05) to find the best settings within");
    options.option("--frames", how_.frames, "of each point; fewer where they take seconds")
        .range(1, 1'000'000)
        .show_default();
    options.option("--size", size_, "pixels of the pictures").show_default().type("WxH");
    options.flag("--json", json_, "print the result as JSON (schema hpr.tradeoff/1) instead of a table");
    options.option("--csv", csv_, "write one line per point to this file").type("FILE");
    options.option("--html", html_, "write the result as one page with plots and crops").type("FILE");
    options.flag("--resume", resume_, "go on with the points of this sweep that an earlier run measured");
    (void)declare_settings(options, settings_, SettingScope::Pictures);
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    check_options(globals);
    watch_requests();
    return run_ranks(globals, [&](Communicator& comm) {
      Session session(comm, globals.session(), [&] { return load_scene(scene_, settings_, globals, how_.size); });
      return sweep(session, globals);
    });
  }

 private:
  void check_options(const Globals& globals) {
    how_.size = parse_size(size_, "--size", kRasterLimit);
    check_size(how_.size, globals.picture_limits());
    std::vector<KnobSweep> sweeps;
    for (const std::string& text : vary_) sweeps.push_back(parse_knob_sweep(text));
    for (const KnobSweep& sweep : sweeps) report_.knobs.push_back(sweep.knob);
    all_ = combinations(sweeps);
    for (const KnobValues& values : all_) {  // bad ones are found before any scene is loaded
      (void)resolve(with_knobs(settings_, values), globals.seed);
    }
    if (metrics_.empty()) metrics_ = tradeoff_metrics();
    for (const std::string& metric : metrics_) (void)PictureError{}.of(metric);
    if (!budget_.empty()) report_.budget = parse_budget(budget_);
    if (report_.budget && !report_.budget->ms && !asks_for(metrics_, report_.budget->metric)) {
      metrics_.push_back(report_.budget->metric);
    }
    how_.metrics = metrics_;
    check_result_files(globals, scene_, {settings_.environment, how_.reference}, {csv_, html_});
  }

  ExitCode sweep(Session& session, const Globals& globals) {
    const bool is_root = session.rank() == 0;
    std::filesystem::path cache;
    agree_on_failure(session.comm(), [&] {
      if (is_root) cache = cache_folder();
    });
    const auto reference = find_reference(session, settings_, how_, globals, cache);
    if (!reference) {
      if (is_root) log::info("stopped: the reference's samples are kept; the same command goes on with them");
      return ExitCode::Stopped;
    }
    const Rect crop = is_root ? most_detail(reference->radiance, kCropSide) : Rect{};
    const std::string identity = sweep_identity(session, *reference, globals);
    const std::filesystem::path state =
        cache / fmt::format("tradeoff-{}.json", hex16(xxh64(std::as_bytes(std::span(identity)))));
    std::vector<TradeoffPoint> done = kept_points(session.comm(), state, identity);

    const MeasuredPoint measure = [&](const KnobValues& values, bool first) {
      done.push_back(measured_point(session, values, globals, *reference, crop, first));
      agree_on_failure(session.comm(), [&] {
        if (is_root) write_file_atomically(state, encode_points(identity, done));
      });
    };
    if (!measure_all(session, globals, done, measure)) return ExitCode::Stopped;
    agree_on_failure(session.comm(), [&] {
      if (!is_root) return;
      finish(session, *reference, crop, globals);
      forget(state, identity, std::move(done));
    });
    const auto broken = [](const TradeoffPoint& point) { return point.rays.not_finite > 0; };
    const int fails = settings_.strict && is_root && std::ranges::any_of(report_.points, broken) ? 1 : 0;
    return all_gather_value(session.comm(), fails).front() == 1 ? ExitCode::CheckFailed : ExitCode::Done;
  }

  /// Collective: measures a point and puts it behind those that are done.
  using MeasuredPoint = std::function<void(const KnobValues& values, bool first)>;

  /// Collective: the report's points, those that are done already (on rank 0) and what is measured of the others. False
  /// when it was asked to stop before the last one.
  [[nodiscard]] bool measure_all(Session& session, const Globals& globals, const std::vector<TradeoffPoint>& done,
                                 const MeasuredPoint& measure) {
    const bool is_root = session.rank() == 0;
    std::size_t measured = 0;
    const auto measure_case = [&](std::size_t i) {
      const auto known = std::ranges::find(done, all_[i], &TradeoffPoint::knobs);
      const bool skips = all_gather_value(session.comm(), known != done.end() ? 1 : 0).front() == 1;
      if (skips) {
        report_.points.push_back(is_root ? *known : TradeoffPoint{});
      } else {
        measure(all_[i], measured++ == 0);
        report_.points.push_back(done.back());
      }
      const std::vector<Request> requests = all_gather_value(session.comm(), take_request());
      return CaseResult{.measured = !skips, .stop = std::ranges::max(requests) == Request::Stop};
    };
    const SweepSettings settings{is_root ? globals.progress : "none", "point", all_.size(), true};
    if (measure_cases(
            settings, [&](std::size_t i) { return describe(all_[i]); }, measure_case))
      return true;
    if (is_root) log::info("stopped after {} of {} points: --resume goes on", report_.points.size(), all_.size());
    return false;
  }

  /// Collective: on rank 0 the points that an earlier run of this sweep measured; without --resume those of other
  /// values alone.
  [[nodiscard]] std::vector<TradeoffPoint> kept_points(Communicator& comm, const std::filesystem::path& state,
                                                       const std::string& identity) const {
    std::vector<TradeoffPoint> kept;
    check_on_root(comm, [&] {
      try {
        std::error_code ignored;
        if (std::filesystem::exists(state, ignored)) {
          const auto bytes = read_file(state, kMaxStateBytes);
          kept = decode_points({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, state.string(), identity);
        }
      } catch (const Error&) {
        if (resume_) throw;
      }
      if (!resume_) std::erase_if(kept, [&](const TradeoffPoint& point) { return is_mine(point); });
      if (resume_ && std::ranges::none_of(kept, [&](const TradeoffPoint& point) { return is_mine(point); })) {
        log::warning("--resume: no points of this sweep are kept, so it begins anew");
      }
    });
    return kept;
  }

  /// The first frames of a process are slower than all others: where that shows, they are drawn once more.
  [[nodiscard]] TradeoffPoint measured_point(Session& session, const KnobValues& values, const Globals& globals,
                                             const ReferencePicture& reference, const Rect& crop, bool first) const {
    TradeoffPoint point = measure_point(session, settings_, values, how_, globals, reference, crop);
    const double elapsed_ms = all_gather_value(session.comm(), point.median_ms()).front();
    if (!first || elapsed_ms >= kQuickMs) return point;
    return measure_point(session, settings_, values, how_, globals, reference, crop);
  }

  [[nodiscard]] std::string sweep_identity(Session& session, const ReferencePicture& reference,
                                           const Globals& globals) const {
    return fmt::format("{} {} {} {}x{} seed {} ranks {} threads {} truth {} metrics {} frames {} options {} varied {}",
                       kVersion, kCommit, hex16(content_hash(session.scene())), how_.size.width, how_.size.height,
                       globals.seed, session.comm().size(), session.threads(),
                       hex16(xxh64(std::as_bytes(reference.radiance.pixels()))), fmt::join(metrics_, ","), how_.frames,
                       fmt::join(base_options(*options_, report_.knobs), " "), fmt::join(report_.knobs, " "));
  }

  /// What is done needs no going on; what an earlier run of other values kept stays. The sweep is done all the same
  /// where that cannot be written.
  void forget(const std::filesystem::path& state, const std::string& identity, std::vector<TradeoffPoint> done) const {
    std::erase_if(done, [&](const TradeoffPoint& point) { return is_mine(point); });
    std::error_code ignored;
    if (done.empty()) {
      std::filesystem::remove(state, ignored);
      return;
    }
    try {
      write_file_atomically(state, encode_points(identity, done));
    } catch (const Error& error) {
      log::warning("{}", error.what());
    }
  }

  [[nodiscard]] bool is_mine(const TradeoffPoint& point) const {
    return std::ranges::find(all_, point.knobs) != all_.end();
  }

  void finish(Session& session, const ReferencePicture& reference, const Rect& crop, const Globals& globals) {
    report_.scene = scene_;
    report_.command = "hpr " + shell_line(globals.args);
    report_.machine = this_machine();
    report_.ranks = session.comm().size();
    report_.threads = session.threads();
    report_.size = how_.size;
    report_.seed = globals.seed;
    report_.reference = reference.about;
    report_.metrics = metrics_;
    report_.base_options = base_options(*options_, report_.knobs);
    report_.reference_crop_png = crop_as_png(reference.radiance, crop, reference.linear);
    mark_pareto(report_.points, metrics_.front());
    if (report_.budget) report_.best = best_within(report_.points, *report_.budget, metrics_.front());
    write_if_named(csv_, [&] { return tradeoff_csv(report_); });
    write_if_named(html_, [&] { return tradeoff_html(report_); });
    std::fputs((json_ ? tradeoff_json(report_) : tradeoff_table(report_)).c_str(), stdout);
    if (std::fflush(stdout) != 0) {
      throw Error(ExitCode::Io, "the result could not be written to standard output",
                  "--resume writes it without measuring again");
    }
    if (json_ && report_.budget) log::info("{}", answer(report_));
  }

  std::optional<OptionSet> options_;
  std::string scene_;
  std::vector<std::string> vary_;
  std::vector<std::string> metrics_;
  std::string budget_;
  std::string size_ = "640x360";
  std::string csv_;
  std::string html_;
  bool json_ = false;
  bool resume_ = false;
  TradeoffMeasurement how_;
  RenderSettings settings_;
  std::vector<KnobValues> all_;
  TradeoffReport report_;
};

}  // namespace

std::unique_ptr<Command> make_tradeoff_command() {
  return std::make_unique<TradeoffCommand>();
}

}  // namespace hpr
