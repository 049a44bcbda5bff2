#include "walls/link/socket.h"

#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/eventfd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <string>
#include <system_error>
#include <utility>

#include "core/error.h"
#include "walls/link/bytes.h"
#include "walls/link/socket_files.h"

namespace hpr {
namespace {

constexpr int kBacklog = 64;
/// A TCP peer that acknowledges nothing for so long is gone.
constexpr unsigned kUnacknowledgedMs = 10'000;

std::string words(int code) {
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
void clear_way(const LinkAddress& address) {
  struct stat found {};
  if (::lstat(address.text.c_str(), &found) != 0) return;
  if (!S_ISSOCK(found.st_mode)) {
    throw Error(ExitCode::Io, fmt::format("'{}' is there and no socket", address.text), "name another place");
  }
  const Socket probe(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (::connect(probe.descriptor(), plain(address), address.length) == 0 || errno != ECONNREFUSED) {
    throw Error(ExitCode::Usage, fmt::format("another process listens on '{}'", address.text),
                "end the other one, or name another place with --listen");
  }
  ::unlink(address.text.c_str());
}

}  // namespace

void make_private_folder(const std::filesystem::path& folder) {
  struct stat found {};
  if (::mkdir(folder.c_str(), 0700) != 0 && errno != EEXIST) {
    throw Error(ExitCode::Io, fmt::format("cannot make the folder '{}': {}", folder.string(), words(errno)),
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

Socket::~Socket() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Listener::Listener(const LinkAddress& address) : tcp_(address.tcp), address_(address.text) {
  if (!tcp_) {
    const std::filesystem::path folder = std::filesystem::path(address.text).parent_path();
    make_private_folder(folder.empty() ? "." : folder);
    clear_way(address);
  }
  socket_ = Socket(::socket(address.storage.ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const int on = 1;
  if (tcp_) ::setsockopt(socket_.descriptor(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  if (!socket_ || ::bind(socket_.descriptor(), plain(address), address.length) != 0) {
    const int code = errno;
    throw Error(code == EADDRINUSE ? ExitCode::Usage : ExitCode::Io,
                fmt::format("cannot listen on '{}': {}", address.text, words(code)),
                "name another place with --listen");
  }
  if ((!tcp_ && ::chmod(address.text.c_str(), 0600) != 0) || ::listen(socket_.descriptor(), kBacklog) != 0) {
    throw Error(ExitCode::Io, fmt::format("cannot listen on '{}': {}", address.text, words(errno)));
  }
  if (!tcp_) {
    remove_when_ended(address.text);
    return;
  }
  sockaddr_storage taken{};
  socklen_t size = sizeof taken;
  if (::getsockname(socket_.descriptor(), reinterpret_cast<sockaddr*>(&taken), &size) != 0) {
    throw Error(ExitCode::Io, fmt::format("cannot listen on '{}': {}", address.text, words(errno)));
  }
  const in_port_t port = taken.ss_family == AF_INET6 ? reinterpret_cast<const sockaddr_in6&>(taken).sin6_port
                                                     : reinterpret_cast<const sockaddr_in&>(taken).sin_port;
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
  if (!socket) throw LinkError(words(errno), errno);
  if (address.tcp) tune(socket);
  if (::connect(socket.descriptor(), plain(address), address.length) != 0 && errno != EINPROGRESS) {
    throw LinkError(words(errno), errno);
  }
  return socket;
}

void finish_connecting(const Socket& socket, bool tcp) {
  int code = 0;
  socklen_t size = sizeof code;
  if (::getsockopt(socket.descriptor(), SOL_SOCKET, SO_ERROR, &code, &size) != 0) code = errno;
  if (code != 0) throw LinkError(words(code), code);
  if (!tcp && !same_user(socket.descriptor())) throw LinkError("the socket belongs to another user");
}

bool has_left(int descriptor) {
  char byte = 0;
  const ssize_t got = ::recv(descriptor, &byte, 1, MSG_PEEK | MSG_DONTWAIT);
  return got == 0 || (got < 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR);
}

Socket make_alarm() {
  Socket alarm(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  if (!alarm) throw Error(ExitCode::Io, fmt::format("no file descriptor is left: {}", words(errno)));
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
