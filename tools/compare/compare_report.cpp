#include "tools/compare/compare_report.h"

#include <fmt/format.h>
#include <hpr/version.h>

#include <algorithm>

#include "core/error.h"
#include "core/json.h"
#include "tools/report/lists.h"

namespace hpr {
namespace {

Json to_json(const CompareRun& run) {
  Json json{{"strategy", run.strategy},
            {"ranks", run.ranks},
            {"transport", run.transport},
            {"frames", run.frames},
            {"ms", {{"min", run.ms.min}, {"median", run.ms.median}, {"p95", run.ms.p95}, {"max", run.ms.max}}},
            {"ms_composite", {{"median", run.ms_composite}}},
            {"ms_collect", {{"median", run.ms_collect}}},
            {"bytes_total", run.bytes_total},
            {"bytes_max_rank", run.bytes_max_rank},
            {"messages_total", run.messages_total},
            {"imbalance", run.imbalance},
            {"differing_pixels", run.differing_pixels},
            {"frame_xxh64", run.frame_xxh64},
            {"predicted_ms", run.predicted_ms}};
  if (!run.chosen.empty()) json["chosen"] = run.chosen;
  if (run.max_error) json["max_error"] = *run.max_error;
  return json;
}

CompareRun run_from(const Json& json) {
  CompareRun run;
  run.strategy = json.at("strategy").get<std::string>();
  run.ranks = json.at("ranks").get<int>();
  run.transport = json.at("transport").get<std::string>();
  run.frames = json.at("frames").get<int>();
  const Json& ms = json.at("ms");
  run.ms = {ms.at("min").get<double>(), ms.at("median").get<double>(), ms.at("p95").get<double>(),
            ms.at("max").get<double>()};
  run.ms_composite = json.at("ms_composite").at("median").get<double>();
  run.ms_collect = json.at("ms_collect").at("median").get<double>();
  run.bytes_total = json.at("bytes_total").get<std::uint64_t>();
  run.bytes_max_rank = json.at("bytes_max_rank").get<std::uint64_t>();
  run.messages_total = json.at("messages_total").get<std::uint64_t>();
  run.imbalance = json.at("imbalance").get<double>();
  run.differing_pixels = json.at("differing_pixels").get<std::uint64_t>();
  run.frame_xxh64 = json.at("frame_xxh64").get<std::string>();
  if (!json.at("predicted_ms").is_null()) run.predicted_ms = json.at("predicted_ms").get<double>();
  run.chosen = json.value("chosen", std::string());
  if (json.contains("max_error")) run.max_error = json.at("max_error").get<double>();
  return run;
}

Json to_json(const std::vector<CompareRun>& runs) {
  Json json = Json::array();
  for (const CompareRun& run : runs) json.push_back(to_json(run));
  return json;
}

/// "1.4" megabytes.
double megabytes(std::uint64_t bytes) {
  return static_cast<double>(bytes) / 1e6;
}

}  // namespace

bool CompareReport::oversubscribed() const {
  // Simulated ranks have the cores their cluster gives them.
  return std::ranges::any_of(
      runs, [&](const CompareRun& run) { return run.transport != "simulated" && run.ranks > machine.cores; });
}

std::string compare_table(const CompareReport& report) {
  std::string text = fmt::format("{}, {} screen{} of {}x{}, seed {}; {}, {} cores{}, {}\n", report.input,
                                 grid_name(report.grid), report.grid.area() == 1 ? "" : "s", report.screen.width,
                                 report.screen.height, report.seed, report.machine.cpu, report.machine.cores,
                                 report.oversubscribed() ? " (fewer than ranks)" : "", report.machine.mpi);
  text += fmt::format("{:<13} {:>5} {:>9} {:>9} {:>8} {:>8} {:>8} {:>9} {:>8} {:>9} {:>8} {:>9} {:>9}  {}\n",
                      "strategy", "ranks", "median ms", "predicted", "min", "p95", "max", "composite", "collect",
                      "MB sent", "messages", "imbalance", "differing", "frame");
  for (const CompareRun& run : report.runs) {
    text += fmt::format(
        "{:<13} {:>5} {:>9.3f} {:>9} {:>8.3f} {:>8.3f} {:>8.3f} {:>9.3f} {:>8.3f} {:>9.2f} {:>8} {:>9.2f} {:>9}  {}\n",
        run.strategy, run.ranks, run.ms.median, run.predicted_ms ? fmt::format("{:.3f}", *run.predicted_ms) : "-",
        run.ms.min, run.ms.p95, run.ms.max, run.ms_composite, run.ms_collect, megabytes(run.bytes_total),
        run.messages_total, run.imbalance, run.differing_pixels, run.frame_xxh64);
    if (run.max_error) text.insert(text.size() - 1, fmt::format("  max error {:.3g}", *run.max_error));
  }
  return text;
}

std::string compare_json(const CompareReport& report) {
  const Json json{
      {"schema", "hpr.compare/1"},
      {"command", report.command},
      {"commit", std::string(kCommit)},
      {"machine",
       {{"cpu", report.machine.cpu},
        {"cores", report.machine.cores},
        {"mpi", report.machine.mpi},
        {"oversubscribed", report.oversubscribed()}}},
      {"image", {{"width", report.screen.width}, {"height", report.screen.height}, {"tiles", grid_name(report.grid)}}},
      {"input", report.input},
      {"operator", report.operation},
      {"seed", report.seed},
      {"runs", to_json(report.runs)}};
  return json.dump(2) + "\n";
}

std::string compare_csv(const CompareReport& report) {
  std::string text =
      "strategy,ranks,transport,frames,ms_min,ms_median,ms_p95,ms_max,ms_composite_median,ms_collect_median,bytes_"
      "total,"
      "bytes_max_rank,messages_total,imbalance,differing_pixels,frame_xxh64,predicted_ms,max_error,chosen\n";
  for (const CompareRun& run : report.runs) {
    text += fmt::format("{},{},{},{},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f},{},{},{},{:.4f},{},{},{},{},{}\n",
                        csv_field(run.strategy), run.ranks, run.transport, run.frames, run.ms.min, run.ms.median,
                        run.ms.p95, run.ms.max, run.ms_composite, run.ms_collect, run.bytes_total, run.bytes_max_rank,
                        run.messages_total, run.imbalance, run.differing_pixels, run.frame_xxh64,
                        run.predicted_ms ? fmt::format("{:.6f}", *run.predicted_ms) : "",
                        run.max_error ? fmt::format("{:.6g}", *run.max_error) : "", csv_field(run.chosen));
  }
  return text;
}

std::string runs_to_json(const std::vector<CompareRun>& runs) {
  return Json{{"runs", to_json(runs)}}.dump() + "\n";
}

std::vector<CompareRun> runs_from_json(std::string_view text) {
  try {
    std::vector<CompareRun> runs;
    const Json document = Json::parse(text);
    for (const Json& json : document.at("runs").elements()) runs.push_back(run_from(json));
    return runs;
  } catch (const JsonError& failure) {
    throw Error(ExitCode::Internal, fmt::format("an MPI job did not hand over its runs: {}", failure.what()));
  }
}

}  // namespace hpr
