#pragma once

#include <sys/socket.h>

#include <filesystem>
#include <string>

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

/// As parse_address, and also what only a listener may say: ":PORT" (loopback), port 0 (any that is free), and a path
/// without a slash.
[[nodiscard]] LinkAddress parse_listen_address(const std::string& text);

/// Throws Error (Usage) for a path longer than sockets take.
[[nodiscard]] LinkAddress socket_address(const std::filesystem::path& path);

}  // namespace hpr
