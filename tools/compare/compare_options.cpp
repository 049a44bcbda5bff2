#include "tools/compare/compare_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "compositing/compositor.h"
#include "core/error.h"
#include "core/job_environment.h"
#include "core/text.h"
#include "tools/simulated_cluster.h"
#include "tools/sweep.h"

namespace hpr {
namespace {

template <typename Strategies>
std::vector<std::string> names_of(const Strategies& strategies) {
  std::vector<std::string> names;
  names.reserve(strategies.size());
  for (const auto& strategy : strategies) names.emplace_back(strategy->name());
  return names;
}

}  // namespace

std::vector<std::string> split_strategies(std::string_view list) {
  std::vector<std::string> names;
  for (const std::string& item : split_commas(list)) {
    const bool is_number = !item.empty() && item.find_first_not_of("0123456789") == std::string::npos;
    if (is_number && !names.empty()) {
      names.back() += "," + item;
    } else {
      names.push_back(item);
    }
  }
  return names;
}

void CompareOptions::declare(const OptionSet& options) {
  options.option("scene", scene, "a scene to draw the layers from").type("SCENE");
  options.option("--synthetic", synthetic, "made-up layers: dense, half, sparse, scatter or checker").type("KIND");
  options.option("--size", size, "pixels of one screen").type("WxH").show_default();
  options.option("--tiles", tiles, "screens of the wall").type("CxR").show_default();
  options.option("--ranks", ranks, "numbers of ranks to run on (2,4; inside an MPI job: that job's)").type("LIST");
  options
      .option("--operator", operator_name,
              "nearest: the nearest surface; over8, overf: translucent layers, ranks from front to back, in 8 bits or "
              "floats a channel")
      .type("NAME")
      .show_default();
  strategies_option_ =
      options.option("--strategies", strategies, "all, or names of strategies").type("LIST").show_default();
  options
      .option("--distribute", distributions,
              "all, or names of distributions and auto: whole frames by each of them, in place of strategies")
      .type("LIST");
  frames_option_ = options.option("--frames", frames, "measured frames").type("N").range(1, 1'000'000).show_default();
  options.option("--warmup", warmup, "frames before the measured ones").type("N").range(0, 1'000'000).show_default();
  options
      .option("--simulate", simulate,
              "run on threads and reckon what a cluster would take: hosts=64,ranks=512,latency=2us,"
              "bandwidth=12.5GB/s[,cores=,overhead=,local-latency=,local-bandwidth=,merge=]")
      .type("CLUSTER");
  options.option("--transport", transport, "mpi, or threads of one process").type("NAME").show_default();
  options.option("--csv", csv, "write one line per run to this file").type("FILE");
  options.option("--html", html, "write the result as one page with plots and drawings").type("FILE");
  options.flag("--json", json, "print the result as JSON (schema hpr.compare/1) instead of a table");
  options.option("-o,--output", picture, "write the composited frame of the last number of ranks").type("FILE.png");
  options.option("--raw", raw, "write that frame's keys: per pixel uint64, row 0 at the top").type("FILE");
  for (const Setting& setting : all_settings()) {
    if (setting.scope == SettingScope::Pictures && setting.name != "distribute") {
      (void)declare_setting(options, settings, setting);
    }
  }
}

void CompareOptions::resolve() {
  if (!simulate.empty() && !frames_option_->specified()) frames = warmup = 1;  // simulated frames are all alike
  check_transport();
  check_operator();
  check_settings();
  if (!distributions.empty()) {
    check_whole_frames();
    (void)rank_counts();
    return;
  }
  for (const int count : rank_counts()) (void)strategies_for(count);
}

void CompareOptions::check_files(const Globals& globals) const {
  if (!picture.empty() && !picture.ends_with(".png")) {
    throw Error(ExitCode::Usage, fmt::format("-o: '{}' does not end in .png", printable(picture)), "name a .png file");
  }
  check_result_files(globals, scene, {}, {csv, html, picture, raw});
}

void CompareOptions::check_transport() const {
  const std::vector<std::string> transports{"mpi", "threads"};
  if (std::ranges::find(transports, transport) == transports.end()) {
    throw Error(ExitCode::Usage, fmt::format("no transport is named '{}'", printable(transport)),
                unknown_name_hint(printable(transport), transports));
  }
  if (inside_mpi_job() && transport != "mpi") {
    throw Error(ExitCode::Usage, "--transport threads runs in one process, not in an MPI job",
                "leave mpirun away, or --transport");
  }
  if (!simulate.empty() && (!ranks.empty() || transport != "mpi" || inside_mpi_job())) {
    throw Error(ExitCode::Usage, "--simulate excludes --ranks, --transport and mpirun",
                "the number of ranks is said by --simulate ranks=N; it runs on threads of one process");
  }
}

CompareOptions::WallSize CompareOptions::wall_size(const Globals& globals) const {
  const Size screen = parse_size(size, "--size", kRasterLimit);
  const Size grid = parse_size(tiles, "--tiles", kMaxScreensASide);
  check_size(screen, globals.picture_limits());
  check_size({screen.width * grid.width, screen.height * grid.height}, globals.picture_limits());
  return {screen, grid};
}

CompareOperator CompareOptions::operation() const {
  if (operator_name == "nearest") return CompareOperator::Nearest;
  return operator_name == "over8" ? CompareOperator::Over8 : CompareOperator::OverFloat;
}

void CompareOptions::check_operator() const {
  const std::vector<std::string> operators{"nearest", "over8", "overf"};
  if (std::ranges::find(operators, operator_name) == operators.end()) {
    throw Error(ExitCode::Usage, fmt::format("no operator is named '{}'", printable(operator_name)),
                unknown_name_hint(printable(operator_name), operators));
  }
  if (operation() != CompareOperator::Nearest && !raw.empty()) {
    throw Error(ExitCode::Usage, "--raw writes keys, and translucent layers have none", "take -o FILE.png");
  }
}

void CompareOptions::check_settings() const {
  if (local_shading() && scene.empty()) {
    throw Error(ExitCode::Usage, "--shading local lights a scene, and there is none",
                "leave it out: synthetic layers are colours already");
  }
  if (!distributions.empty()) return;
  for (const std::string_view name : settings.specified) {
    if (name == "shading") continue;
    throw Error(ExitCode::Usage, fmt::format("--{} is about whole frames, and compare merges layers of keys", name),
                "leave it out, or compare whole frames with --distribute all");
  }
}

void CompareOptions::check_whole_frames() const {
  const auto refuse = [](const char* option, const char* hint) {
    throw Error(ExitCode::Usage, fmt::format("--distribute draws whole frames of a scene, and excludes {}", option),
                hint);
  };
  if (!synthetic.empty()) refuse("--synthetic", "name a scene instead");
  if (!simulate.empty()) refuse("--simulate", "hpr bench scale and --ranks measure frames on this machine");
  if (operation() != CompareOperator::Nearest) refuse("--operator", "leave it out: the nearest surface is drawn");
  if (strategies_option_->specified()) refuse("--strategies", "--strategy NAME says which one composites the frames");
  if (settings.sampling.goal.seconds) {
    throw Error(ExitCode::Usage, "--distribute compares the same frame: --spp until a time makes others",
                "write e.g. --spp 16");
  }
  if (settings.frame.rays.show == Show::Rank)
    refuse("--show rank", "each distribution shows other ranks: use hpr render");
  if (!raw.empty()) check_raw(settings);
}

std::vector<int> CompareOptions::rank_counts() const {
  if (!simulate.empty()) return {parse_simulation(simulate).ranks};
  if (!ranks.empty()) return parse_counts(ranks, "--ranks");
  return inside_mpi_job() ? std::vector<int>{} : std::vector<int>{2, 4};
}

std::vector<std::string> CompareOptions::all_strategies_for(int count) const {
  std::vector<std::string> names;
  const auto add_fitting = [&](const auto& candidates) {
    for (const auto& strategy : candidates) {
      if (strategy->fits(count)) names.emplace_back(strategy->name());
    }
  };
  if (operation() == CompareOperator::Nearest) {
    add_fitting(all_compositors());
    if (!scene.empty()) names.emplace_back(kSortFirst);
  } else {
    add_fitting(all_blenders<RgbaPremultiplied>());
  }
  return names;
}

std::vector<std::string> CompareOptions::strategies_for(int count) const {
  if (strategies == "all") return all_strategies_for(count);
  std::vector<std::string> names;
  for (const std::string& name : split_strategies(strategies)) {
    check_strategy(name);
    if (name != kSortFirst && !fits(name, count)) {
      throw Error(ExitCode::Usage, fmt::format("strategy {} cannot run on {} ranks", name, count),
                  "leave it out, or choose another number with --ranks");
    }
    names.push_back(name);
  }
  return names;
}

void CompareOptions::check_strategy(const std::string& name) const {
  if (name == "all") {
    throw Error(ExitCode::Usage, fmt::format("--strategies {}: 'all' stands alone", printable(strategies)),
                "write --strategies all, or leave it out of the list");
  }
  const bool nearest = operation() == CompareOperator::Nearest;
  if (name == kSortFirst) {
    if (!nearest) {
      throw Error(ExitCode::Usage, fmt::format("sort-first does not go with --operator {}", operator_name),
                  "leave it out, or take --operator nearest");
    }
    if (!scene.empty()) return;
    throw Error(ExitCode::Usage, "sort-first draws a scene, and there is none", "name a scene instead of --synthetic");
  }
  if (has_compositor(name)) return;
  std::vector<std::string> choices =
      nearest ? names_of(all_compositors()) : names_of(all_blenders<RgbaPremultiplied>());
  if (nearest && !scene.empty()) choices.emplace_back(kSortFirst);
  choices.emplace_back("all");
  throw Error(ExitCode::Usage, fmt::format("no compositing strategy is named '{}'", printable(name)),
              unknown_name_hint(printable(name), choices));
}

bool CompareOptions::fits(const std::string& name, int count) const {
  if (operation() == CompareOperator::Nearest) return make_compositor(name)->fits(count);
  return make_blender<RgbaPremultiplied>(name)->fits(count);
}

CompareSettings CompareOptions::settings_for(int count) const {
  return {strategies_for(count), {warmup, frames}, operation()};
}

std::vector<std::string> CompareOptions::arguments(const Globals& globals) const {
  std::vector<std::string> all{"compare"};
  if (!scene.empty()) all.push_back(scene);
  if (!synthetic.empty()) all.insert(all.end(), {"--synthetic", synthetic});
  for (const std::string& plugin : globals.plugins) all.insert(all.end(), {"--plugin", plugin});
  all.insert(all.end(), {"--size", size, "--tiles", tiles, "--strategies", strategies});
  if (local_shading()) all.insert(all.end(), {"--shading", "local"});
  if (operation() != CompareOperator::Nearest) all.insert(all.end(), {"--operator", operator_name});
  all.insert(all.end(), {"--frames", std::to_string(frames), "--warmup", std::to_string(warmup)});
  if (simulate.empty()) {
    all.insert(all.end(), {"--transport", transport});
  } else {
    all.insert(all.end(), {"--simulate", simulate});
  }
  all.insert(all.end(), {"--seed", std::to_string(globals.seed)});
  if (globals.backend != "auto") all.insert(all.end(), {"--backend", globals.backend});
  if (globals.device >= 0) all.insert(all.end(), {"--device", std::to_string(globals.device)});
  if (globals.threads > 0) all.insert(all.end(), {"--threads", std::to_string(globals.threads)});
  return all;
}

}  // namespace hpr
