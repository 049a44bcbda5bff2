#include "app/console/line_source.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <random>
#include <vector>

#include "core/log.h"
#include "core/names.h"

namespace hpr {
namespace {

constexpr std::size_t kLongestLine = 4096;
constexpr std::size_t kMostClients = 8;
constexpr int kAnswerMs = 1000;

[[noreturn]] void throw_socket(const std::string& address) {
  throw Error(ExitCode::Io, fmt::format("cannot listen on '{}': {}", printable(address), std::strerror(errno)),
              "name a path nobody uses in a folder you may write to, or ADDRESS:PORT of this host");
}

std::string random_token() {
  std::random_device device;
  std::string token;
  for (int i = 0; i < 4; ++i) token += fmt::format("{:08x}", device());
  return token;
}

/// Whether the process at the other end runs as the same user.
bool same_user(int socket) {
  ucred peer{};
  socklen_t size = sizeof peer;
  return ::getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0 && peer.uid == ::geteuid();
}

}  // namespace

LineSource::LineSource(const Options& options) : standard_input_(options.standard_input) {
  if (standard_input_) clients_[STDIN_FILENO].trusted = true;
  if (options.listen.empty()) return;
  if (options.listen.find('/') == std::string::npos && options.listen.find(':') != std::string::npos) {
    listen_on_port(options.listen);
  } else {
    listen_on_path(options.listen);
  }
}

LineSource::~LineSource() {
  for (const auto& [client, state] : clients_) {
    if (client != STDIN_FILENO) ::close(client);
  }
  if (listener_ >= 0) ::close(listener_);
  std::error_code ignored;
  if (!socket_file_.empty()) std::filesystem::remove(socket_file_, ignored);
}

void LineSource::listen_on_path(const std::string& path) {
  sockaddr_un name{};
  name.sun_family = AF_UNIX;
  if (path.size() >= sizeof name.sun_path) {
    throw Error(ExitCode::Usage, fmt::format("'{}' is too long for a socket", printable(path)),
                fmt::format("at most {} bytes", sizeof name.sun_path - 1));
  }
  std::memcpy(name.sun_path, path.data(), path.size());
  const auto* const address = reinterpret_cast<const sockaddr*>(&name);
  listener_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (listener_ < 0) throw_socket(path);
  // A socket nobody answers at is what a killed run left behind.
  std::error_code ignored;
  if (std::filesystem::is_socket(path, ignored)) {
    const int probe = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const bool answered = ::connect(probe, address, sizeof name) == 0;
    ::close(probe);
    if (!answered) std::filesystem::remove(path, ignored);
  }
  const mode_t before = ::umask(0177);
  const bool bound = ::bind(listener_, address, sizeof name) == 0;
  ::umask(before);
  if (!bound || ::listen(listener_, kMostClients) != 0) {
    const int why = errno;
    ::close(listener_);
    listener_ = -1;
    errno = why;
    throw_socket(path);
  }
  socket_file_ = path;
  address_ = path;
}

void LineSource::listen_on_port(const std::string& address) {
  const std::size_t colon = address.rfind(':');
  const std::string host = colon == 0 ? "127.0.0.1" : address.substr(0, colon);
  const std::string digits = address.substr(colon + 1);
  std::uint16_t port = 0;
  const auto parsed = std::from_chars(digits.data(), digits.data() + digits.size(), port);
  sockaddr_in name{};
  name.sin_family = AF_INET;
  if (parsed.ec != std::errc() || parsed.ptr != digits.data() + digits.size() ||
      ::inet_pton(AF_INET, host.c_str(), &name.sin_addr) != 1) {
    throw Error(ExitCode::Usage, fmt::format("'{}' is no address to listen on", printable(address)),
                "write e.g. 127.0.0.1:7000, or the path of a Unix socket");
  }
  name.sin_port = htons(port);
  listener_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const int on = 1;
  socklen_t size = sizeof name;
  auto* const plain = reinterpret_cast<sockaddr*>(&name);
  if (listener_ < 0 || ::setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) != 0 ||
      ::bind(listener_, plain, size) != 0 || ::listen(listener_, kMostClients) != 0 ||
      ::getsockname(listener_, plain, &size) != 0) {
    const int why = errno;
    if (listener_ >= 0) ::close(listener_);
    listener_ = -1;
    errno = why;
    throw_socket(address);
  }
  address_ = fmt::format("{}:{}", host, ntohs(name.sin_port));
  token_ = random_token();
}

void LineSource::accept_client() {
  const int client = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
  if (client < 0) return;
  if (clients_.size() >= kMostClients || (token_.empty() && !same_user(client))) {
    log::warning("a client of the console was turned away: {}",
                 clients_.size() >= kMostClients ? "there are too many" : "it is another user's");
    ::close(client);
    return;
  }
  clients_[client].trusted = token_.empty();
}

void LineSource::drop(int client) {
  clients_.erase(client);
  if (client == STDIN_FILENO) {
    standard_input_ = false;
  } else {
    ::close(client);
  }
}

bool LineSource::read_from(int client) {
  std::array<char, kLongestLine> buffer{};
  const ssize_t count = ::read(client, buffer.data(), buffer.size());
  if (count < 0) return errno == EAGAIN || errno == EINTR;
  Client& state = clients_[client];
  if (count == 0) {
    if (client != STDIN_FILENO || state.received.empty()) return false;
    state.received += '\n';  // a last line without its end; the next read ends it
    return true;
  }
  state.received.append(buffer.data(), static_cast<std::size_t>(count));
  return client == STDIN_FILENO || state.received.find('\n') != std::string::npos ||
         state.received.size() <= kLongestLine;
}

std::optional<InputLine> LineSource::take_line() {
  for (auto& [client, state] : clients_) {
    const std::size_t end = state.received.find('\n');
    if (end == std::string::npos) continue;
    InputLine line{client, state.received.substr(0, end)};
    state.received.erase(0, end + 1);
    if (line.text.ends_with('\r')) line.text.pop_back();
    if (state.trusted) return line;
    if (line.text != "token " + token_) {
      log::warning("a client of the console was turned away: it does not know the token");
      drop(client);
    } else {
      state.trusted = true;
      answer(line, "ok\n");
    }
    return take_line();
  }
  return std::nullopt;
}

std::optional<InputLine> LineSource::next(std::chrono::milliseconds longest) {
  if (auto line = take_line()) return line;
  std::vector<pollfd> watched;
  for (const auto& [client, state] : clients_) watched.push_back({client, POLLIN, 0});
  if (listener_ >= 0) watched.push_back({listener_, POLLIN, 0});
  if (::poll(watched.data(), watched.size(), static_cast<int>(longest.count())) <= 0) return std::nullopt;
  for (const pollfd& each : watched) {
    if (each.revents == 0) continue;
    if (each.fd == listener_) {
      accept_client();
    } else if (!read_from(each.fd)) {
      drop(each.fd);
    }
  }
  return take_line();
}

void LineSource::answer(const InputLine& line, const std::string& text) {
  if (line.from == STDIN_FILENO) {
    fmt::print("{}", text);
    std::fflush(stdout);
    return;
  }
  std::string_view left = text;
  while (!left.empty()) {
    const ssize_t sent = ::send(line.from, left.data(), left.size(), MSG_NOSIGNAL);
    if (sent > 0) {
      left.remove_prefix(static_cast<std::size_t>(sent));
      continue;
    }
    pollfd ready{line.from, POLLOUT, 0};
    if ((errno != EAGAIN && errno != EINTR) || ::poll(&ready, 1, kAnswerMs) <= 0) {
      drop(line.from);
      return;
    }
  }
}

}  // namespace hpr
