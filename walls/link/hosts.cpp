#include "walls/link/hosts.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>

#include "core/bytes.h"
#include "core/error.h"
#include "core/text.h"

namespace hpr {
namespace {

constexpr std::size_t kMaxHostNameBytes = 40;

std::string plain_host(const std::string& host) {
  return host.empty() || host == "*" ? "localhost" : host;
}

std::string host_of(const Wall& wall, const WallScreen& screen) {
  const auto node = std::ranges::find(wall.nodes, screen.node, &WallNode::id);
  return plain_host(node == wall.nodes.end() ? "" : node->host);
}

}  // namespace

std::vector<WallHost> wall_hosts(const Wall& wall) {
  std::vector<WallHost> hosts;
  for (std::size_t i = 0; i < wall.screens.size(); ++i) {
    const std::string name = host_of(wall, wall.screens[i]);
    auto host = std::ranges::find(hosts, name, &WallHost::host);
    if (host == hosts.end()) host = hosts.insert(hosts.end(), {name, {}});
    host->screens.push_back(i);
  }
  return hosts;
}

WallHost find_host(const Wall& wall, const std::string& name) {
  const std::vector<WallHost> hosts = wall_hosts(wall);
  const auto node = std::ranges::find(wall.nodes, name, &WallNode::id);
  const std::string wanted = node == wall.nodes.end() ? plain_host(name) : plain_host(node->host);
  // A host's name comes before another node's id.
  for (const std::string& one : {plain_host(name), wanted}) {
    const auto host = std::ranges::find(hosts, one, &WallHost::host);
    if (host != hosts.end()) return *host;
  }
  std::vector<std::string> choices;
  choices.reserve(hosts.size());
  for (const WallHost& host : hosts) choices.push_back(host.host);
  throw Error(ExitCode::Usage, fmt::format("the wall has no screens on host '{}'", printable(name)),
              unknown_name_hint(name, choices));
}

Wall wall_of_host(const Wall& wall, const WallHost& host) {
  Wall part = wall;
  part.screens.clear();
  for (std::size_t i = 0; i < wall.screens.size(); ++i) {
    const bool here = std::ranges::find(host.screens, i) != host.screens.end();
    (here ? part.screens : part.elsewhere).push_back(wall.screens[i]);
  }
  return part;
}

std::vector<LinkScreen> link_screens(const Wall& wall, const WallHost& host) {
  std::vector<LinkScreen> screens;
  for (const std::size_t screen : host.screens)
    screens.push_back({wall.screens[screen].id, wall.screens[screen].pixels});
  return screens;
}

std::filesystem::path socket_folder() {
  const char* const runtime = std::getenv("XDG_RUNTIME_DIR");
  return runtime != nullptr && *runtime == '/' ? std::filesystem::path(runtime) / "hpr"
                                               : std::filesystem::path(fmt::format("/tmp/hpr-{}", ::geteuid()));
}

std::filesystem::path display_socket(const Wall& wall, const std::string& host) {
  const bool plain = !host.empty() && host.size() <= kMaxHostNameBytes && std::ranges::all_of(host, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '.';
  });
  return socket_folder() /
         fmt::format("{}-{}.sock", hex16(wall.hash), plain ? host : hex16(xxh64(std::as_bytes(std::span(host)))));
}

}  // namespace hpr
