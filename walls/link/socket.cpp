#include "walls/link/socket.h"

#include <fmt/format.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/eventfd.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstring>
#include <ctime>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "core/error.h"
#include "core/file.h"
#include "core/text.h"
#include "walls/link/protocol.h"

namespace hpr {
namespace {

[[noreturn]] void no_address(const std::string& text) {
  throw Error(ExitCode::Usage, fmt::format("'{}' is no address", printable(text)),
              "write HOST:PORT, [IPV6]:PORT, or the path of a socket with a slash in it");
}

LinkAddress tcp_address(const std::string& text, unsigned lowest_port) {
  const std::size_t colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0) no_address(text);
  std::string host = text.substr(0, colon);
  const std::string port = text.substr(colon + 1);
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  unsigned number = 0;
  const auto [end, failed] = std::from_chars(port.data(), port.data() + port.size(), number);
  if (failed != std::errc() || end != port.data() + port.size() || number < lowest_port || number > 65535)
    no_address(text);

  addrinfo wanted{};
  wanted.ai_socktype = SOCK_STREAM;
  addrinfo* list = nullptr;
  const int code = ::getaddrinfo(host.c_str(), port.c_str(), &wanted, &list);
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> found(code == 0 ? list : nullptr, &::freeaddrinfo);
  if (!found) {
    throw Error(ExitCode::Io, fmt::format("cannot find the host of '{}': {}", printable(text), ::gai_strerror(code)),
                "check the name, or write the number");
  }
  LinkAddress address;
  address.text = text;
  address.tcp = true;
  std::memcpy(&address.storage, found->ai_addr, found->ai_addrlen);
  address.length = found->ai_addrlen;
  return address;
}

/// Handlers reach nothing but globals. A path is written while it is not set, and by one thread at a time.
struct SocketFile {
  std::atomic<bool> set = false;
  std::array<char, sizeof(sockaddr_un::sun_path) + 1> path{};
};
std::array<SocketFile, 16> files;
std::mutex writing;

extern "C" void remove_and_end(int signal) {
  for (const SocketFile& file : files) {
    if (file.set.load()) ::unlink(file.path.data());
  }
  ::raise(signal);  // waits until this returns, and then finds no handler
}

/// Has, from now on, a SIGINT, SIGTERM or SIGHUP that ends this process remove the file of a Unix socket first: those
/// that are caught or ignored already keep what they do. Of more than 16 files the others stay.
void remove_when_ended(const std::string& path) {
  const std::lock_guard lock(writing);
  for (SocketFile& file : files) {
    if (file.set.load() || path.size() >= file.path.size()) continue;
    file.path.fill('\0');
    path.copy(file.path.data(), path.size());
    file.set.store(true);
    break;
  }
  struct sigaction action {};
  action.sa_handler = remove_and_end;
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction before {};
    ::sigaction(signal, nullptr, &before);
    if (before.sa_handler == SIG_DFL) ::sigaction(signal, &action, nullptr);
  }
}

/// Takes back remove_when_ended(): the file is removed already.
void forget_removal(const std::string& path) {
  const std::lock_guard lock(writing);
  for (SocketFile& file : files) {
    if (file.set.load() && std::string_view(file.path.data()) == path) file.set.store(false);
  }
}

constexpr int kBacklog = 64;
/// A TCP peer that acknowledges nothing for so long is gone.
constexpr unsigned kUnacknowledgedMs = 10'000;

std::string error_text(int code) {
  return std::generic_category().message(code);
}

const sockaddr* plain(const LinkAddress& address) {
  return reinterpret_cast<const sockaddr*>(&address.storage);
}

void tune(const Socket& socket) {
  const int on = 1;
  ::setsockopt(socket.descriptor(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  ::setsockopt(socket.descriptor(), SOL_SOCKET, SO_KEEPALIVE, &on, sizeof on);
  ::setsockopt(socket.descriptor(), IPPROTO_TCP, TCP_USER_TIMEOUT, &kUnacknowledgedMs, sizeof kUnacknowledgedMs);
}

bool same_user(int descriptor) {
  ucred peer{};
  socklen_t size = sizeof peer;
  if (::getsockopt(descriptor, SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) return false;
  return peer.uid == ::geteuid() || peer.uid == 0;
}

/// What a killed process left is removed; what a living one listens on is not.
void remove_stale_socket(const LinkAddress& address) {
  struct stat found {};
  if (::lstat(address.text.c_str(), &found) != 0) return;
  if (!S_ISSOCK(found.st_mode)) {
    throw Error(ExitCode::Io, fmt::format("'{}' is there and no socket", address.text), "name another place");
  }
  if (!is_refusing(address.text)) {
    throw Error(ExitCode::Usage, fmt::format("another process listens on '{}'", address.text),
                "end the other one, or name another place with --listen");
  }
  ::unlink(address.text.c_str());
}

}  // namespace

LinkAddress socket_address(const std::filesystem::path& path) {
  LinkAddress address;
  address.text = path.string();
  sockaddr_un name{};
  name.sun_family = AF_UNIX;
  if (address.text.size() >= sizeof name.sun_path) {
    throw Error(ExitCode::Usage, fmt::format("the socket's path '{}' is too long", printable(address.text, 160)),
                fmt::format("sockets take {} bytes: set XDG_RUNTIME_DIR to a shorter one, or use --listen",
                            sizeof name.sun_path - 1));
  }
  std::memcpy(name.sun_path, address.text.c_str(), address.text.size() + 1);
  std::memcpy(&address.storage, &name, sizeof name);
  address.length = static_cast<socklen_t>(sizeof name);
  return address;
}

LinkAddress parse_address(const std::string& text) {
  if (text.find('/') != std::string::npos) return socket_address(text);
  return tcp_address(text, 1);
}

LinkAddress parse_listen_address(const std::string& text) {
  if (text.find('/') != std::string::npos) return socket_address(text);
  if (!text.empty() && text.find(':') == std::string::npos) return socket_address("./" + text);
  return tcp_address(text.starts_with(':') ? "127.0.0.1" + text : text, 0);
}

void make_private_folder(const std::filesystem::path& folder) {
  struct stat found {};
  if (::mkdir(folder.c_str(), 0700) != 0 && errno != EEXIST) {
    throw Error(ExitCode::Io, fmt::format("cannot make the folder '{}': {}", folder.string(), error_text(errno)),
                "set XDG_RUNTIME_DIR to a folder of yours, or use --listen");
  }
  if (::lstat(folder.c_str(), &found) != 0 || !S_ISDIR(found.st_mode)) {
    throw Error(ExitCode::Io, fmt::format("'{}' is no folder", folder.string()), "name another place with --listen");
  }
  // In /tmp others may write, but not touch what is ours.
  const bool owner_is_trusted = found.st_uid == ::geteuid() || found.st_uid == 0;
  const bool others_may_write = (found.st_mode & 022U) != 0 && (found.st_mode & S_ISVTX) == 0;
  if (!owner_is_trusted || others_may_write) {
    throw Error(ExitCode::Io, fmt::format("others may change the folder '{}'", folder.string()),
                "take it from them (chown, chmod 0700), or name another place with --listen");
  }
}

bool is_refusing(const std::filesystem::path& socket) {
  const LinkAddress address = socket_address(socket);
  const Socket probe(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  // EAGAIN: whoever listens is busy, and others wait already.
  return ::connect(probe.descriptor(), plain(address), address.length) != 0 &&
         (errno == ECONNREFUSED || errno == ENOENT);
}

void remove_left_sockets(const std::filesystem::path& folder) {
  constexpr std::time_t kYoungSeconds = 10;
  for (const std::filesystem::path& entry : entries_of(folder)) {
    struct stat info {};
    const std::string path = entry.string();
    if (::lstat(path.c_str(), &info) != 0 || !S_ISSOCK(info.st_mode) || info.st_uid != ::geteuid()) continue;
    if (path.size() >= sizeof(sockaddr_un::sun_path)) continue;
    if (info.st_mtime + kYoungSeconds < std::time(nullptr) && is_refusing(path)) ::unlink(path.c_str());
  }
}

Socket::~Socket() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Listener::Listener(const LinkAddress& address) : tcp_(address.tcp), address_(address.text) {
  if (!tcp_) {
    const std::filesystem::path folder = std::filesystem::path(address.text).parent_path();
    make_private_folder(folder.empty() ? "." : folder);
    remove_stale_socket(address);
  }
  socket_ = Socket(::socket(address.storage.ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const int on = 1;
  if (tcp_) ::setsockopt(socket_.descriptor(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  if (!socket_ || ::bind(socket_.descriptor(), plain(address), address.length) != 0) {
    const int code = errno;
    throw Error(code == EADDRINUSE ? ExitCode::Usage : ExitCode::Io,
                fmt::format("cannot listen on '{}': {}", address.text, error_text(code)),
                "name another place with --listen");
  }
  if ((!tcp_ && ::chmod(address.text.c_str(), 0600) != 0) || ::listen(socket_.descriptor(), kBacklog) != 0) {
    throw Error(ExitCode::Io, fmt::format("cannot listen on '{}': {}", address.text, error_text(errno)));
  }
  if (!tcp_) {
    remove_when_ended(address.text);
    return;
  }
  sockaddr_storage bound{};
  socklen_t size = sizeof bound;
  if (::getsockname(socket_.descriptor(), reinterpret_cast<sockaddr*>(&bound), &size) != 0) {
    throw Error(ExitCode::Io, fmt::format("cannot listen on '{}': {}", address.text, error_text(errno)));
  }
  const in_port_t port = bound.ss_family == AF_INET6 ? reinterpret_cast<const sockaddr_in6&>(bound).sin6_port
                                                     : reinterpret_cast<const sockaddr_in&>(bound).sin_port;
  address_ = fmt::format("{}:{}", address.text.substr(0, address.text.rfind(':')), ntohs(port));
}

Listener::~Listener() {
  if (!socket_ || tcp_) return;
  ::unlink(address_.c_str());
  forget_removal(address_);
}

Listener::Listener(Listener&& other) noexcept
    : socket_(std::move(other.socket_)), tcp_(other.tcp_), address_(std::move(other.address_)) {}

std::optional<Socket> Listener::accept() const {
  Socket made(::accept4(socket_.descriptor(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
  if (!made) return std::nullopt;
  if (tcp_) {
    tune(made);
  } else if (!same_user(made.descriptor())) {
    return std::nullopt;
  }
  return made;
}

Socket start_connecting(const LinkAddress& address) {
  Socket socket(::socket(address.storage.ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!socket) throw LinkError(error_text(errno), errno);
  if (address.tcp) tune(socket);
  if (::connect(socket.descriptor(), plain(address), address.length) != 0 && errno != EINPROGRESS) {
    throw LinkError(error_text(errno), errno);
  }
  return socket;
}

void finish_connecting(const Socket& socket, bool tcp) {
  int code = 0;
  socklen_t size = sizeof code;
  if (::getsockopt(socket.descriptor(), SOL_SOCKET, SO_ERROR, &code, &size) != 0) code = errno;
  if (code != 0) throw LinkError(error_text(code), code);
  if (!tcp && !same_user(socket.descriptor())) throw LinkError("the socket belongs to another user");
}

bool has_left(int descriptor) {
  char byte = 0;
  const ssize_t got = ::recv(descriptor, &byte, 1, MSG_PEEK | MSG_DONTWAIT);
  return got == 0 || (got < 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR);
}

Socket make_alarm() {
  Socket alarm(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  if (!alarm) throw Error(ExitCode::Io, fmt::format("no file descriptor is left: {}", error_text(errno)));
  return alarm;
}

void raise_alarm(const Socket& alarm) {
  (void)::eventfd_write(alarm.descriptor(), 1);
}

void clear_alarm(const Socket& alarm) {
  eventfd_t count = 0;
  (void)::eventfd_read(alarm.descriptor(), &count);
}

}  // namespace hpr
