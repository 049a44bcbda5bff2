#include "engine/wall/run_control.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

#include "core/file.h"
#include "core/job_board.h"
#include "core/log.h"
#include "core/text.h"
#include "core/timing.h"
#include "engine/render_settings.h"
#include "engine/session.h"
#include "engine/wall/command_table.h"
#include "engine/wall/line_source.h"
#include "walls/link/hosts.h"
#include "walls/link/protocol.h"
#include "walls/link/socket.h"

namespace hpr {
namespace {

constexpr std::string_view kPrefix = "wall-";
constexpr std::string_view kSuffix = ".sock";
constexpr std::string_view kRefused = "error ";  ///< then the exit code's number, and why

/// socket_folder(), made if missing, without what killed processes left: where running walls of this user are reached,
/// and nobody else may write. Throws Error (Io) when it cannot be made, or is another's.
std::filesystem::path control_folder() {
  make_private_folder(socket_folder());
  remove_left_sockets(socket_folder());
  return socket_folder();
}

/// To the run that listens there. Throws LinkError.
Socket connect_to(const std::filesystem::path& path) {
  const LinkAddress address = socket_address(path);
  Socket socket = start_connecting(address);
  finish_connecting(socket, address.tcp);
  return socket;
}

/// Throws Error (Io).
Socket call(const RunningWall& wall, const std::string& line) {
  int code = 0;
  try {
    Socket socket = connect_to(wall.socket);
    if (::send(socket.descriptor(), line.data(), line.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(line.size())) {
      return socket;
    }
  } catch (const LinkError& error) {
    code = error.code();
  }
  throw Error(ExitCode::Io, fmt::format("run {} does not answer", wall.run),
              code == EAGAIN ? "too many wait for it already: try again after its frame"
                             : "it may just have ended: hpr wall status");
}

/// `text`: "CODE why".
[[noreturn]] void throw_refusal(const std::string& text) {
  const std::size_t space = std::min(text.find(' '), text.size() - 1);
  for (const ExitCode code : {ExitCode::BadInput, ExitCode::Io, ExitCode::Limit}) {
    if (text.substr(0, space) == std::to_string(static_cast<int>(code))) throw Error(code, text.substr(space + 1));
  }
  throw Error(ExitCode::Usage, text.substr(space + 1), "hpr wall ctl help lists what can be said");
}

std::string last_line(const std::string& text) {
  if (!text.ends_with('\n')) return "";
  const std::size_t before = text.size() < 2 ? std::string::npos : text.rfind('\n', text.size() - 2);
  return text.substr(before == std::string::npos ? 0 : before + 1);
}

}  // namespace

RunControl::RunControl(Session& session, RenderSettings& settings, std::uint64_t seed, SceneLoader load,
                       std::function<std::string()> status, std::function<void()> apply,
                       std::function<void(const std::string&)> record)
    : session_(session),
      controls_(session, settings, seed, std::move(load), table_),
      settings_(settings),
      apply_(std::move(apply)),
      record_(std::move(record)) {
  table_.add(
      {"status", "", "what the wall shows and how long it takes, as JSON",
       [this, status = std::move(status)](Arguments) { return session_.comm().rank() == 0 ? status() : std::string(); },
       true});
  table_.add({"stop", "", "end the run after this frame", [this](Arguments) {
                stops_ = true;
                return std::string();
              }});
  if (session_.comm().rank() != 0) return;
  try {
    source_.emplace(LineSource::Options{
        .listen = (control_folder() / fmt::format("{}{}{}", kPrefix, ::getpid(), kSuffix)).string()});
  } catch (const Error& error) {
    log::warning("the run cannot be told anything while it lasts: {} ({})", error.what(), error.hint());
  }
}

std::string RunControl::apply_command(const std::string& line) {
  const std::uint64_t before = controls_.changes();
  const RenderSettings settings = settings_;
  const auto stall_limit = report_stall_limit({});  // a scene may take as long as it likes to load
  std::string answer;
  try {
    answer = table_.run(line);
  } catch (const Error&) {
    report_stall_limit(stall_limit);
    throw;
  }
  if (controls_.changes() == before) {
    report_stall_limit(stall_limit);
    return answer;
  }
  try {
    apply_();
  } catch (const Error& error) {
    if (!is_recoverable(error)) throw;
    settings_ = settings;
    apply_();
    throw;
  }
  record_(line);
  return answer;
}

void RunControl::replay(std::span<const std::string> lines) {
  for (const std::string& line : lines) {
    try {
      (void)table_.run(line);
    } catch (const Error& error) {
      if (!is_recoverable(error)) throw;
      log::warning("'{}' cannot be done again: {}", printable(line), error.what());
    }
  }
}

void RunControl::poll() {
  std::optional<InputLine> from;
  while (const auto line = poll_input(session_.comm(), source_ ? &*source_ : nullptr, {}, from).line) {
    std::string answer;
    try {
      const std::string result = apply_command(*line);
      answer = result.empty() ? "ok\n" : result + "\nok\n";
    } catch (const Error& error) {
      if (!is_recoverable(error)) throw;
      answer = fmt::format("{}{} {} ({})\n", kRefused, static_cast<int>(error.code()), error.what(), error.hint());
    }
    if (from) source_->answer(*from, answer);
  }
}

bool RunControl::any_waiting() {
  return source_ && source_->any_waiting([this](const std::string& line) { return !table_.only_tells(line); });
}

std::vector<RunningWall> running_walls() {
  std::vector<RunningWall> walls;
  for (const std::filesystem::path& entry : entries_of(control_folder())) {
    const std::string name = entry.filename().string();
    if (!name.starts_with(kPrefix) || !name.ends_with(kSuffix)) continue;
    if (is_refusing(entry)) continue;  // it begins, or was killed just now
    walls.push_back({name.substr(kPrefix.size(), name.size() - kPrefix.size() - kSuffix.size()), entry});
  }
  std::ranges::sort(walls, {}, &RunningWall::run);
  return walls;
}

std::string send_command(const RunningWall& wall, const std::string& line, std::chrono::milliseconds timeout) {
  const Socket socket = call(wall, line + "\n");
  const Stopwatch watch;
  std::string answer;
  while (true) {
    const std::string last = last_line(answer);
    if (last == "ok\n") return answer.substr(0, answer.size() - last.size());
    if (last.starts_with(kRefused)) throw_refusal(last.substr(kRefused.size(), last.size() - kRefused.size() - 1));
    pollfd ready{socket.descriptor(), POLLIN, 0};
    const int left = static_cast<int>(std::min(static_cast<double>(timeout.count()) - watch.ms(), 60'000.0));
    std::array<char, 4096> buffer{};
    if (left <= 0 || ::poll(&ready, 1, left) <= 0) break;
    const ssize_t count = ::recv(socket.descriptor(), buffer.data(), buffer.size(), 0);
    if (count <= 0) break;
    answer.append(buffer.data(), static_cast<std::size_t>(count));
  }
  throw Error(ExitCode::Io, fmt::format("run {} gave no answer within {} s", wall.run, timeout.count() / 1000),
              "it answers between frames: wait longer with --wait");
}

}  // namespace hpr
