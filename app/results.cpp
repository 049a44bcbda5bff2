#include "app/results.h"

#include <fmt/format.h>
#include <hpr/version.h>
#include <sys/stat.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "cluster/transport/collectives.h"
#include "cluster/transport/communicator_wrappers.h"
#include "cluster/transport/local_communicator.h"
#include "core/error.h"
#include "core/file.h"
#include "core/job_environment.h"
#include "core/json.h"
#include "core/log.h"
#include "core/text.h"
#include "core/timing.h"
#include "engine/wall/wall_status.h"
#include "rt/passes/pass_list.h"
#include "scene/load_scene.h"
#include "walls/manifest/manifest.h"

namespace hpr {

void write_or_print(std::string_view text, const std::string& path, bool overwrite) {
  if (path.empty()) {
    fmt::print("{}", text);
    return;
  }
  check_writable(path, overwrite);
  write_file_atomically(path, text);
}

void check_distinct(std::span<const std::string> paths, const std::string& trace) {
  std::set<std::filesystem::path> named;
  std::vector<std::string> all(paths.begin(), paths.end());
  all.push_back(trace);
  for (const std::string& path : all) {
    std::error_code error;
    const std::filesystem::path plain = std::filesystem::absolute(path, error);
    const std::filesystem::path canonical = std::filesystem::weakly_canonical(plain, error);
    if (path.empty() || named.insert(error ? plain : canonical).second) continue;
    throw Error(ExitCode::Usage, fmt::format("'{}' is named for two results", printable(path)),
                "give each its own name");
  }
}

void check_spared(const std::string& scene, const SceneLimits& limits, std::span<const std::string> inputs,
                  std::span<const std::string> results) {
  const auto identity = [](const std::filesystem::path& path) -> std::optional<std::pair<dev_t, ino_t>> {
    struct stat info {};
    if (path.empty() || ::stat(path.c_str(), &info) != 0) return std::nullopt;
    return std::pair(info.st_dev, info.st_ino);
  };
  std::map<std::pair<dev_t, ino_t>, std::string> replaced;
  for (const std::string& result : results) {
    if (const auto file = identity(result)) replaced.emplace(*file, result);
  }
  if (replaced.empty()) return;  // spares reading the scene twice
  std::vector<std::filesystem::path> files = files_of_scene(scene, limits);
  files.insert(files.end(), inputs.begin(), inputs.end());
  for (const std::filesystem::path& path : files) {
    const auto file = identity(path);
    const auto result = file ? replaced.find(*file) : replaced.end();
    if (result == replaced.end()) continue;
    throw Error(ExitCode::Usage, fmt::format("'{}' is read, and would be replaced", printable(result->second)),
                "give the result another name");
  }
}

namespace {

Json not_finite_json(const RayCounts& rays) {
  Json first;
  if (rays.not_finite > 0) {
    const ScreenPixel& pixel = rays.first_not_finite;
    first = {{"screen", pixel.screen}, {"x", pixel.x}, {"y", pixel.y}};
  }
  return {{"pixels", rays.not_finite}, {"first", first}};
}

Json balance_json(const BalanceReport& report) {
  return {{"mode", kBalanceNames.at(static_cast<std::size_t>(report.balance))},
          {"slowest_over_mean", report.slowest_over_mean},
          {"keys", report.keys},
          {"light", report.light},
          {"lent", report.lent}};
}

}  // namespace

void write_stats(const std::filesystem::path& path, const RunStats& stats) {
  Json passes = Json::array();
  for (const PassTime& time : stats.times) {
    const auto plan = std::ranges::find(stats.passes, time.pass, &PassPlan::pass);
    passes.push_back(
        {{"name", time.name}, {"ms", time.ms}, {"why", plan == stats.passes.end() ? "every frame" : plan->why}});
  }
  Json rays{{"primary", stats.rays.primary}};
  for (const PassInfo& pass : all_passes()) rays[pass.name] = stats.rays[pass.id];
  Json json{{"schema", "hpr.stats/1"},
            {"ms", stats.ms},
            {"samples", stats.samples},
            {"samples_in_all", stats.samples_in_all},
            {"ms_per_sample", stats.samples > 0 ? Json(stats.ms / stats.samples) : Json()},
            {"estimated_relmse", stats.relmse},
            {"plan", stats.plan},
            {"passes", passes},
            {"raster",
             {{"chunks_culled", stats.raster.chunks_culled},
              {"chunks_drawn", stats.raster.chunks_drawn},
              {"triangles_culled", stats.raster.triangles_culled},
              {"triangles_drawn", stats.raster.triangles_drawn},
              {"pixels_read", stats.raster.pixels_read},
              {"cull_ms", stats.raster.cull_ms},
              {"draw_ms", stats.raster.draw_ms},
              {"read_ms", stats.raster.read_ms},
              {"pack_ms", stats.raster.pack_ms}}},
            {"rays", rays},
            {"rays_cut", stats.rays.cut},
            {"rays_invalid", stats.rays.invalid},
            {"not_finite", not_finite_json(stats.rays)},
            {"exposure", stats.display ? Json(stats.display->exposure_stops) : Json()},
            {"tone", stats.display ? Json(name_of(stats.display->tone)) : Json()},
            {"bytes_sent", stats.bytes_sent},
            {"memory_peak_bytes_per_rank", stats.memory_peak_bytes},
            {"balance", balance_json(stats.balance)},
            {"ranks", stats.ranks}};
  if (stats.budget) json["budget"] = budget_json(to_record(*stats.budget));
  if (!stats.page_loads.empty()) json["page_loads_per_rank"] = stats.page_loads;
  if (stats.verify) json["verify"] = verify_json(to_record(*stats.verify));
  write_file_atomically(path, json.dump(2) + "\n");
}

namespace {

/// Collective. The time of a barrier by this rank's clock. Ranks of rank 0's host have its clock: times so close are no
/// chance.
std::int64_t barrier_ns(Communicator& comm) {
  constexpr std::int64_t kSameClock = 1'000'000'000;
  barrier(comm);
  const std::vector<std::int64_t> times = all_gather_value(comm, trace::now_ns());
  const std::int64_t mine = times[static_cast<std::size_t>(comm.rank())];
  return std::abs(mine - times[0]) < kSameClock ? times[0] : mine;
}

Json named(const char* what, int rank, int lane, const std::string& name) {
  return {{"name", what}, {"ph", "M"}, {"pid", rank}, {"tid", lane}, {"args", {{"name", name}}}};
}

/// This process's events, one to a line: `rank`'s, or those of ranks that are its threads.
std::string lines_of(int rank, const std::string& host, const trace::Record& record, std::int64_t zero) {
  std::string text;
  const auto add = [&](const Json& line) { text += (text.empty() ? "" : ",\n") + line.dump(); };
  std::set<int> processes;
  std::set<std::pair<int, int>> rows;
  for (const trace::Event& event : record.events) {
    const int process = rank + event.rank;
    if (processes.insert(process).second) {
      add(named("process_name", process, 0, fmt::format("rank {} on {}", process, host)));
      add({{"name", "process_sort_index"},
           {"ph", "M"},
           {"pid", process},
           {"tid", 0},
           {"args", {{"sort_index", process}}}});
    }
    if (rows.insert({process, event.lane}).second) {
      const std::string name = event.lane == 0                    ? "main"
                               : event.lane == trace::kDeviceLane ? "device"
                                                                  : fmt::format("thread {}", event.lane);
      add(named("thread_name", process, event.lane, name));
    }
    Json line{{"name", event.name},
              {"ph", "X"},
              {"ts", static_cast<double>(event.begin_ns - zero) / 1000.0},
              {"dur", static_cast<double>(event.end_ns - event.begin_ns) / 1000.0},
              {"pid", process},
              {"tid", event.lane}};
    if (event.detail != nullptr) line["args"][event.detail] = event.amount;
    add(line);
  }
  return text;
}

constexpr std::string_view kBeginning = "{\"displayTimeUnit\"";

/// Whether a file stands there that is no trace. An empty one is nothing to lose.
bool holds_something_else(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return false;
  std::ifstream file(path, std::ios::binary);
  std::string start(kBeginning.size(), '\0');
  file.read(start.data(), static_cast<std::streamsize>(start.size()));
  return file.gcount() > 0 && start != kBeginning;
}

std::string document(const std::vector<std::vector<std::byte>>& lines, const std::vector<std::string>& args,
                     std::uint64_t dropped) {
  const Json about{{"schema", "hpr.trace/1"},
                   {"command", "hpr " + shell_line(args)},
                   {"version", fmt::format("{} ({})", kVersion, kCommit)},
                   {"dropped", dropped}};
  std::string text(kBeginning);
  text += fmt::format(": \"ms\", \"otherData\": {},\n\"traceEvents\": [\n", about.dump());
  for (std::size_t rank = 0; rank < lines.size(); ++rank) {
    if (rank > 0) text += ",\n";
    text.append(reinterpret_cast<const char*>(lines[rank].data()), lines[rank].size());
  }
  return text + "\n]}\n";
}

}  // namespace

ExitCode traced(Communicator& comm, const Globals& globals, const std::function<ExitCode(Communicator&)>& body) {
  if (globals.trace.empty()) return body(comm);
  if (inside_mpi_job()) check_on_root(comm, [&] { check_trace(globals); });
  const std::string host = host_name();
  const std::int64_t zero = barrier_ns(comm);
  trace::start();
  TracingCommunicator tracing(comm);
  ExitCode code = ExitCode::Internal;
  try {
    const trace::Span whole("run");
    code = body(tracing);
  } catch (...) {
    (void)trace::finish();
    throw;
  }
  const trace::Record record = trace::finish();
  std::uint64_t dropped = 0;
  for (const std::uint64_t each : all_gather_value(comm, record.dropped)) dropped += each;
  const std::string mine = lines_of(comm.rank(), host, record, zero);
  const std::vector<std::vector<std::byte>> lines = gather(comm, std::as_bytes(std::span(mine)));
  agree_on_failure(comm, [&] {
    if (comm.rank() != 0) return;
    if (holds_something_else(globals.trace)) {
      throw Error(ExitCode::Usage,
                  fmt::format("'{}' now holds something else, so there is no trace", printable(globals.trace)),
                  "give --trace a name of its own");
    }
    write_file_atomically(globals.trace, document(lines, globals.args, dropped));
    if (dropped > 0) {
      log::warning("--trace: {} spans past the first {} of a rank are left out", dropped, trace::kMaxEvents);
    }
  });
  return code;
}

void check_trace(const Globals& globals) {
  if (globals.trace.empty()) return;
  const bool resumes = std::ranges::find(globals.args, "--resume") != globals.args.end();
  check_writable(globals.trace, globals.force || resumes);
  if (!holds_something_else(globals.trace)) return;
  throw Error(ExitCode::Usage,
              fmt::format("'{}' is no trace, and --trace replaces nothing else", printable(globals.trace)),
              "name another file, or remove it first");
}

ExitCode traced_alone(const Globals& globals, const std::function<ExitCode()>& body) {
  if (globals.trace.empty()) return body();
  ExitCode code = ExitCode::Done;
  run_local_ranks(
      1, [&](Communicator& comm) { code = traced(comm, globals, [&](Communicator& /*alone*/) { return body(); }); },
      globals.hang_limit());
  return code;
}

namespace {

/// An error takes three lines, so none of its parts may hold a line break of its own.
std::string one_line(std::string_view text) {
  std::string line(text);
  std::ranges::replace(line, '\n', ' ');
  return printable(line, 2000);
}

}  // namespace

void print_error(const Error& error, std::string_view who) {
  std::string text = fmt::format("hpr: error: {}{}\n", who, one_line(error.what()));
  if (!error.line().empty()) text += fmt::format("  | {}\n", printable(error.line(), 160));
  if (!error.hint().empty()) text += fmt::format("  hint: {}\n", one_line(error.hint()));
  std::fputs(text.c_str(), stderr);
}

}  // namespace hpr
