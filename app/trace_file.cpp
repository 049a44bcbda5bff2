#include "app/trace_file.h"

#include <fmt/format.h>
#include <hpr/version.h>
#include <unistd.h>

#include <array>
#include <nlohmann/json.hpp>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "app/shell_line.h"
#include "cluster/collectives.h"
#include "cluster/local_communicator.h"
#include "cluster/scene_distribution.h"
#include "cluster/texts.h"
#include "cluster/tracing_communicator.h"
#include "core/file.h"
#include "core/log.h"
#include "core/trace.h"

namespace hpr {
namespace {

using Json = nlohmann::ordered_json;

std::string host_name() {
  std::array<char, 256> name{};
  ::gethostname(name.data(), name.size() - 1);
  return name.data();
}

/// When the ranks met, by this rank's clock. Ranks of rank 0's host have the same clock as it.
std::int64_t meet(Communicator& comm, const std::vector<std::string>& hosts) {
  barrier(comm);
  const std::vector<std::int64_t> met = all_gather_value(comm, trace::now_ns());
  const auto mine = static_cast<std::size_t>(comm.rank());
  return hosts[mine] == hosts[0] ? met[0] : met[mine];
}

Json named(const char* what, int rank, int lane, const std::string& name) {
  return {{"name", what}, {"ph", "M"}, {"pid", rank}, {"tid", lane}, {"args", {{"name", name}}}};
}

/// This rank's events, one to a line.
std::string lines_of(int rank, const std::string& host, const trace::Record& record, std::int64_t zero) {
  std::string lines = named("process_name", rank, 0, fmt::format("rank {} on {}", rank, host)).dump();
  lines +=
      ",\n" +
      Json{{"name", "process_sort_index"}, {"ph", "M"}, {"pid", rank}, {"tid", 0}, {"args", {{"sort_index", rank}}}}
          .dump();
  std::set<int> lanes;
  for (const trace::Event& event : record.events) {
    if (lanes.insert(event.lane).second) {
      const std::string name = event.lane == 0 ? "main" : fmt::format("thread {}", event.lane);
      lines += ",\n" + named("thread_name", rank, event.lane, name).dump();
    }
    Json line{{"name", event.name},
              {"ph", "X"},
              {"ts", static_cast<double>(event.begin_ns - zero) / 1000.0},
              {"dur", static_cast<double>(event.end_ns - event.begin_ns) / 1000.0},
              {"pid", rank},
              {"tid", event.lane}};
    if (event.detail != nullptr) line["args"][event.detail] = event.amount;
    lines += ",\n" + line.dump(-1, ' ', false, Json::error_handler_t::replace);
  }
  return lines;
}

std::string document(const std::vector<std::vector<std::byte>>& lines, const std::vector<std::string>& args,
                     std::uint64_t dropped) {
  const Json about{{"schema", "hpr.trace/1"},
                   {"command", "hpr " + shell_line(args)},
                   {"version", fmt::format("{} ({})", kVersion, kCommit)},
                   {"dropped", dropped}};
  std::string text = fmt::format("{{\"displayTimeUnit\": \"ms\", \"otherData\": {},\n\"traceEvents\": [\n",
                                 about.dump(-1, ' ', false, Json::error_handler_t::replace));
  for (std::size_t rank = 0; rank < lines.size(); ++rank) {
    if (rank > 0) text += ",\n";
    text.append(reinterpret_cast<const char*>(lines[rank].data()), lines[rank].size());
  }
  return text + "\n]}\n";
}

}  // namespace

ExitCode traced(Communicator& comm, const Globals& globals, const std::function<ExitCode(Communicator&)>& body) {
  if (globals.trace.empty()) return body(comm);
  const std::string host = host_name();
  const std::int64_t zero = meet(comm, all_gather_texts(comm, host));
  trace::start();
  TracingCommunicator watched(comm);
  ExitCode code = ExitCode::Internal;
  try {
    const trace::Span whole("run");
    code = body(watched);
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
    write_file_atomically(globals.trace, document(lines, globals.args, dropped));
    if (dropped > 0) {
      log::warning("--trace: {} spans past the first {} of a rank are left out", dropped, trace::kMostEvents);
    }
  });
  return code;
}

ExitCode traced_alone(const Globals& globals, const std::function<ExitCode()>& body) {
  if (globals.trace.empty()) return body();
  ExitCode code = ExitCode::Done;
  run_local_ranks(
      1, [&](Communicator& comm) { code = traced(comm, globals, [&](Communicator& /*alone*/) { return body(); }); },
      globals.hang_limit());
  return code;
}

}  // namespace hpr
