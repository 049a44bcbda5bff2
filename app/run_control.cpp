#include "app/run_control.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "app/console/forgivable.h"
#include "cluster/collectives.h"
#include "core/log.h"
#include "core/stopwatch.h"
#include "walls/link/hosts.h"
#include "walls/link/socket.h"

namespace hpr {
namespace {

constexpr std::string_view kPrefix = "wall-";
constexpr std::string_view kSuffix = ".sock";

/// A connected Unix socket; -1 where nobody listens.
class Connection {
 public:
  explicit Connection(const std::filesystem::path& path) : socket_(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un name{};
    name.sun_family = AF_UNIX;
    const std::string text = path.string();
    const bool fits = text.size() < sizeof name.sun_path;
    if (fits) std::memcpy(name.sun_path, text.data(), text.size());
    if (!fits || ::connect(socket_, reinterpret_cast<const sockaddr*>(&name), sizeof name) != 0) {
      ::close(socket_);
      socket_ = -1;
    }
  }
  ~Connection() {
    if (socket_ >= 0) ::close(socket_);
  }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  [[nodiscard]] int socket() const { return socket_; }

 private:
  int socket_;
};

std::string last_line(const std::string& text) {
  if (!text.ends_with('\n')) return "";
  const std::size_t before = text.size() < 2 ? std::string::npos : text.rfind('\n', text.size() - 2);
  return text.substr(before == std::string::npos ? 0 : before + 1);
}

}  // namespace

std::filesystem::path control_folder() {
  make_private_folder(socket_folder());
  return socket_folder();
}

RunControl::RunControl(Session& session, const Globals& globals, RenderOptions& options,
                       std::function<std::string()> status)
    : session_(session), controls_(session, globals, options, table_) {
  table_.add({"status", "", "what the wall shows and how long it takes, as JSON",
              [this, status](Words) { return session_.comm().rank() == 0 ? status() : std::string(); }});
  table_.add({"stop", "", "end the run after this frame", [this](Words) {
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

std::optional<std::string> RunControl::hear(std::chrono::milliseconds longest, std::optional<InputLine>& line) {
  std::string said;
  if (source_) line = source_->next(longest);
  if (line) said = "+" + line->text;
  std::vector<std::byte> bytes(std::as_bytes(std::span(said)).begin(), std::as_bytes(std::span(said)).end());
  broadcast(session_.comm(), bytes);
  if (bytes.empty()) return std::nullopt;
  return std::string(reinterpret_cast<const char*>(bytes.data()) + 1, bytes.size() - 1);
}

bool RunControl::attend(std::chrono::milliseconds longest) {
  const std::uint64_t before = controls_.changes();
  std::optional<InputLine> line;
  while (const auto heard = hear(longest, line)) {
    std::string answer;
    try {
      const std::string told = table_.run(*heard);
      answer = told.empty() ? "ok\n" : told + "\nok\n";
    } catch (const Error& error) {
      if (!is_forgivable(error)) throw;
      answer = fmt::format("error: {} ({})\n", error.what(), error.hint());
    }
    if (line) source_->answer(*line, answer);
    line.reset();
    longest = {};
  }
  return controls_.changes() != before;
}

std::vector<RunningWall> running_walls() {
  std::vector<RunningWall> walls;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(control_folder())) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(kPrefix) || !name.ends_with(kSuffix)) continue;
    if (Connection(entry.path()).socket() < 0) {
      std::filesystem::remove(entry.path(), ignored);
      continue;
    }
    walls.push_back({name.substr(kPrefix.size(), name.size() - kPrefix.size() - kSuffix.size()), entry.path()});
  }
  std::ranges::sort(walls, {}, &RunningWall::run);
  return walls;
}

std::string ask(const RunningWall& wall, const std::string& line, std::chrono::milliseconds longest) {
  const Connection connection(wall.socket);
  const std::string said = line + "\n";
  if (connection.socket() < 0 || ::send(connection.socket(), said.data(), said.size(), MSG_NOSIGNAL) < 0) {
    throw Error(ExitCode::Io, fmt::format("run {} does not answer", wall.run),
                "it may just have ended: hpr wall status");
  }
  const Stopwatch watch;
  std::string answer;
  while (true) {
    const std::string last = last_line(answer);
    if (last == "ok\n") return answer.substr(0, answer.size() - last.size());
    if (last.starts_with("error: ")) {
      throw Error(ExitCode::Usage, last.substr(7, last.size() - 8), "hpr wall ctl help lists what can be said");
    }
    pollfd ready{connection.socket(), POLLIN, 0};
    const int left = static_cast<int>(static_cast<double>(longest.count()) - watch.ms());
    std::array<char, 4096> buffer{};
    if (left <= 0 || ::poll(&ready, 1, left) <= 0) break;
    const ssize_t count = ::recv(connection.socket(), buffer.data(), buffer.size(), 0);
    if (count <= 0) break;
    answer.append(buffer.data(), static_cast<std::size_t>(count));
  }
  throw Error(ExitCode::Io, fmt::format("run {} gave no answer within {} s", wall.run, longest.count() / 1000),
              "it answers between frames: wait longer with --wait");
}

}  // namespace hpr
