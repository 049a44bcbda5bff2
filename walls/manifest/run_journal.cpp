#include "walls/manifest/run_journal.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <span>
#include <utility>

#include "core/bytes.h"
#include "core/job_environment.h"
#include "core/json.h"
#include "core/log.h"

namespace hpr {
namespace {

constexpr std::string_view kSecret = "secret ";
constexpr std::string_view kFrame = "frame ";
constexpr std::string_view kRestart = "restart ";
constexpr std::string_view kCommand = "command ";
constexpr std::string_view kBegin = "begin {}";
constexpr std::string_view kEnd = "end {}";

}  // namespace

RunJournal::RunJournal(TemporaryFile file) : file_(std::move(file)), path_(file_->path()) {
  std::array<std::uint64_t, 2> secret{};
  fill_random(std::as_writable_bytes(std::span(secret)));
  append(fmt::format("{}{}\n", kSecret, Json(hex16(secret[0]) + hex16(secret[1])).dump()));
}

std::optional<RunJournal> RunJournal::of_supervisor() {
  const char* const path = std::getenv(kVariable);  // NOLINT(concurrency-mt-unsafe): nobody writes the environment
  if (path == nullptr || !launched_by_hpr()) return std::nullopt;  // a process of theirs may have it too
  return RunJournal(std::filesystem::path(path));
}

void RunJournal::append(const std::string& line) const {
  // One write: a job that is killed leaves whole lines and at most one part of one.
  const int file = ::open(path_.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
  const bool written = file >= 0 && ::write(file, line.data(), line.size()) == static_cast<ssize_t>(line.size());
  if (file >= 0) ::close(file);
  if (!written) log::warning("cannot write '{}': a restart would begin anew", path_.string());
}

void RunJournal::add_begin() {
  append(fmt::format("{}\n", kBegin));
}

void RunJournal::add_frame(const std::string& record) {
  append(fmt::format("{}{}\n", kFrame, record));
}

void RunJournal::add_restart(const std::string& why) {
  const Json record{{"frame", read().frames.size()}, {"why", why}};
  keep_restart(record.dump());
}

void RunJournal::keep_restart(const std::string& record) {
  append(fmt::format("\n{}{}\n", kRestart, record));
}

void RunJournal::add_command(const std::string& line) {
  append(fmt::format("{}{}\n", kCommand, Json(line).dump_ascii()));
}

void RunJournal::add_end() {
  append(fmt::format("{}\n", kEnd));
}

RunJournal::Entries RunJournal::read() const {
  Entries entries;
  std::ifstream file(path_);
  std::string line;
  while (std::getline(file, line)) {
    const bool whole = !file.eof();
    const std::size_t space = line.find(' ');
    if (!whole || space == std::string::npos) continue;
    const std::string record = line.substr(space + 1);
    const std::optional<Json> json = Json::try_parse(record);
    if (!json) continue;
    if (line.starts_with(kSecret)) entries.secret = json->string();
    if (line.starts_with(kFrame)) entries.frames.push_back(record);
    if (line.starts_with(kRestart)) entries.restarts.push_back(record);
    if (line.starts_with(kCommand)) entries.commands.push_back(json->string());
    if (line == kBegin) ++entries.begun;
    entries.ended = entries.ended || line == kEnd;
  }
  return entries;
}

}  // namespace hpr
