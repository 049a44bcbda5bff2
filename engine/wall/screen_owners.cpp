#include "engine/wall/screen_owners.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstddef>
#include <optional>

#include "core/log.h"

namespace hpr {
namespace {

/// A rank that writes pictures first loads the image module, which costs as much as encoding this many pixels.
constexpr std::size_t kPixelsWorthAWriter = 4'000'000;

/// Some machines call themselves by their whole name, wall01.lab.org.
bool same_host(const std::string& a, const std::string& b) {
  return a == b || a.substr(0, a.find('.')) == b || a == b.substr(0, b.find('.'));
}

/// Ranks of the screen's own host.
std::vector<int> ranks_near(const Wall& wall, const WallScreen& screen, const std::vector<std::string>& hosts) {
  std::vector<int> near;
  const auto node = std::ranges::find(wall.nodes, screen.node, &WallNode::id);
  if (node == wall.nodes.end()) return near;
  for (std::size_t rank = 0; rank < hosts.size(); ++rank) {
    if (same_host(node->host, hosts[rank])) near.push_back(static_cast<int>(rank));
  }
  return near;
}

/// The first screen before this one that shows in the same window.
std::optional<std::size_t> window_mate(const Wall& wall, std::size_t screen) {
  if (wall.screens[screen].window.empty()) return std::nullopt;
  for (std::size_t before = 0; before < screen; ++before) {
    if (wall.screens[before].window == wall.screens[screen].window) return before;
  }
  return std::nullopt;
}

/// Screens that are not shown where the wall says.
struct Misplaced {
  std::vector<std::string> hosts;  ///< without a rank, each once
  std::size_t homeless = 0;        ///< screens of those hosts
  std::vector<int> beyond;         ///< ranks the job does not have

  void add_homeless(const std::string& host) {
    ++homeless;
    if (std::ranges::find(hosts, host) == hosts.end()) hosts.push_back(host);
  }

  void tell(int ranks) const {
    if (!beyond.empty()) {
      log::warning("{} screen{} of ranks {} to {}, but there are only {}: others show {}", beyond.size(),
                   beyond.size() == 1 ? " is" : "s are", std::ranges::min(beyond), std::ranges::max(beyond), ranks,
                   beyond.size() == 1 ? "it" : "them");
    }
    if (hosts.empty()) return;
    constexpr std::size_t kMostNames = 4;
    const std::size_t named = std::min(hosts.size(), kMostNames);
    log::warning("no rank runs on {}{}: others show {} screen{}",
                 fmt::join(hosts.begin(), hosts.begin() + static_cast<std::ptrdiff_t>(named), ", "),
                 hosts.size() > named ? fmt::format(" and {} more hosts", hosts.size() - named) : "", homeless,
                 homeless == 1 ? "" : "s");
  }
};

}  // namespace

std::vector<int> owners_of(const Wall& wall, const std::vector<std::string>& hosts, bool remote) {
  const int ranks = static_cast<int>(hosts.size());
  std::size_t pixels = 0;
  for (const WallScreen& screen : wall.screens) pixels += screen.pixels.area();
  const std::size_t writers = std::clamp<std::size_t>(pixels / kPixelsWorthAWriter, 1, hosts.size());

  std::vector<int> owners;
  owners.reserve(wall.screens.size());
  Misplaced misplaced;
  for (std::size_t i = 0; i < wall.screens.size(); ++i) {
    const WallScreen& screen = wall.screens[i];
    if (const auto mate = window_mate(wall, i)) {
      owners.push_back(owners[*mate]);
      continue;
    }
    const std::vector<int> near = ranks_near(wall, screen, hosts);
    if (screen.rank >= 0 && screen.rank < ranks) {
      owners.push_back(screen.rank);
    } else if (!near.empty()) {
      owners.push_back(near[i % near.size()]);
    } else {
      owners.push_back(static_cast<int>(i * writers / wall.screens.size()));
    }
    if (screen.rank >= ranks) misplaced.beyond.push_back(screen.rank);
    const auto node = std::ranges::find(wall.nodes, screen.node, &WallNode::id);
    const bool any_host = node == wall.nodes.end() || node->host == "localhost" || node->host == "*";
    if (screen.rank < 0 && near.empty() && !any_host && !remote) misplaced.add_homeless(node->host);
  }
  misplaced.tell(ranks);
  return owners;
}

}  // namespace hpr
