#pragma once

#include <sys/socket.h>

#include <filesystem>
#include <optional>
#include <string>
#include <utility>

namespace hpr {

/// Where a process listens: a Unix socket's path, or a TCP address.
struct LinkAddress {
  std::string text;  ///< as users write it: "/run/user/1000/hpr/x.sock", "10.0.0.5:5005", "[::1]:5005"
  bool tcp = false;
  sockaddr_storage storage{};
  socklen_t length = 0;
};

/// A path (what holds a slash) or HOST:PORT. Throws Error: Usage for anything else, Io for a host nobody knows.
[[nodiscard]] LinkAddress parse_address(const std::string& text);

/// Parses what parse_address takes, and also what only a listener may name: ":PORT" (loopback), port 0 (any that is
/// free), and a path without a slash.
[[nodiscard]] LinkAddress parse_listen_address(const std::string& text);

/// Throws Error (Usage) for a path longer than sockets take.
[[nodiscard]] LinkAddress socket_address(const std::filesystem::path& path);

/// A file descriptor that is closed with its owner.
class Socket {
 public:
  Socket() = default;
  explicit Socket(int descriptor) : descriptor_(descriptor) {}
  ~Socket();
  Socket(const Socket&) = delete;
  Socket(Socket&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  Socket& operator=(Socket&& other) noexcept {
    std::swap(descriptor_, other.descriptor_);
    return *this;
  }
  Socket& operator=(const Socket&) = delete;

  /// -1: none.
  [[nodiscard]] int descriptor() const { return descriptor_; }
  explicit operator bool() const { return descriptor_ >= 0; }

 private:
  int descriptor_ = -1;
};

/// Makes the folder with mode 0700 where it is missing: in /tmp anybody could have made it before. Throws Error (Io)
/// when it cannot be made, or others may change what is ours in it.
void make_private_folder(const std::filesystem::path& folder);

/// Whether nobody listens on this Unix socket (any more), or there is none.
[[nodiscard]] bool is_refusing(const std::filesystem::path& socket);

/// Removes this user's Unix sockets in `folder` on which nobody listens any more. Nothing younger than ten seconds: a
/// process that begins has a socket for an instant before it listens.
void remove_left_sockets(const std::filesystem::path& folder);

/// A listening socket; a Unix socket's file goes with it.
class Listener {
 public:
  /// Makes a Unix socket's folder where it is missing (mode 0700; the socket has 0600) and takes the place of a socket
  /// nobody listens on any more. Throws Error: Usage when another process listens there, Io when it cannot be had, or
  /// when others may change what is in its folder.
  explicit Listener(const LinkAddress& address);
  ~Listener();
  Listener(const Listener&) = delete;
  Listener(Listener&& other) noexcept;
  Listener& operator=(const Listener&) = delete;
  Listener& operator=(Listener&&) = delete;

  [[nodiscard]] int descriptor() const { return socket_.descriptor(); }
  [[nodiscard]] bool tcp() const { return tcp_; }
  /// What it was given, with the port that was taken.
  [[nodiscard]] const std::string& address() const { return address_; }
  /// Whoever waits, non-blocking; none when nobody does, or on a Unix socket another user.
  [[nodiscard]] std::optional<Socket> accept() const;

 private:
  Socket socket_;
  bool tcp_ = false;
  std::string address_;
};

/// Starts to connect, without waiting. Throws LinkError when it fails at once.
[[nodiscard]] Socket start_connecting(const LinkAddress& address);

/// Completes a connection, once the socket of start_connecting() can be written. Throws LinkError when it did not
/// connect, or when a Unix socket's listener is another user.
void finish_connecting(const Socket& socket, bool tcp);

/// Whether the other end of a stream has closed it. Takes nothing that arrived, and does not wait.
[[nodiscard]] bool has_left(int descriptor);

/// An eventfd: wakes whoever polls it.
[[nodiscard]] Socket make_alarm();
void raise_alarm(const Socket& alarm);
void clear_alarm(const Socket& alarm);

}  // namespace hpr
