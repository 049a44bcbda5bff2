#include "walls/link/address.h"

#include <fmt/format.h>
#include <netdb.h>
#include <sys/un.h>

#include <charconv>
#include <cstring>
#include <memory>

#include "core/error.h"
#include "core/text.h"

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

}  // namespace hpr
