#include "app/screen_owners.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "core/log.h"

namespace hpr {
namespace {

/// A rank that writes pictures first loads the image module, which costs as much as encoding this many pixels.
constexpr std::size_t kPixelsWorthAWriter = 4'000'000;

/// Some machines call themselves by their whole name, wall01.lab.org.
bool same_host(const std::string& a, const std::string& b) {
  return a == b || a.substr(0, a.find('.')) == b || a == b.substr(0, b.find('.'));
}

}  // namespace

std::vector<int> owners_of(const Wall& wall, const std::vector<std::string>& hosts, bool remote) {
  const int ranks = static_cast<int>(hosts.size());
  std::size_t pixels = 0;
  for (const WallScreen& screen : wall.screens) pixels += screen.pixels.area();
  const std::size_t writers = std::clamp<std::size_t>(pixels / kPixelsWorthAWriter, 1, hosts.size());

  std::vector<int> owners;
  std::vector<std::string> missing;  ///< hosts
  std::size_t homeless = 0;
  std::vector<int> beyond;  ///< ranks the job does not have
  for (std::size_t i = 0; i < wall.screens.size(); ++i) {
    const WallScreen& screen = wall.screens[i];
    const auto node = std::ranges::find(wall.nodes, screen.node, &WallNode::id);
    const auto same_window =
        std::ranges::find(wall.screens.begin(), wall.screens.begin() + static_cast<std::ptrdiff_t>(i), screen.window,
                          &WallScreen::window);
    if (!screen.window.empty() && same_window != wall.screens.begin() + static_cast<std::ptrdiff_t>(i)) {
      owners.push_back(owners[static_cast<std::size_t>(same_window - wall.screens.begin())]);
      continue;
    }
    std::vector<int> on_its_host;
    for (int rank = 0; rank < ranks; ++rank) {
      if (node != wall.nodes.end() && same_host(node->host, hosts[static_cast<std::size_t>(rank)])) {
        on_its_host.push_back(rank);
      }
    }
    if (screen.rank >= 0 && screen.rank < ranks) {
      owners.push_back(screen.rank);
    } else if (!on_its_host.empty()) {
      owners.push_back(on_its_host[i % on_its_host.size()]);
    } else {
      owners.push_back(static_cast<int>(i * writers / wall.screens.size()));
    }
    const bool any_host = node == wall.nodes.end() || node->host == "localhost" || node->host == "*";
    if (screen.rank < 0 && on_its_host.empty() && !any_host && !remote) {
      ++homeless;
      if (std::ranges::find(missing, node->host) == missing.end()) missing.push_back(node->host);
    }
    if (screen.rank >= ranks) beyond.push_back(screen.rank);
  }
  if (!beyond.empty()) {
    log::warning("{} screen{} of ranks {} to {}, but there are only {}: others show {}", beyond.size(),
                 beyond.size() == 1 ? " is" : "s are", std::ranges::min(beyond), std::ranges::max(beyond), ranks,
                 beyond.size() == 1 ? "it" : "them");
  }
  if (!missing.empty()) {
    constexpr std::size_t kMostNames = 4;
    const std::size_t named = std::min(missing.size(), kMostNames);
    log::warning("no rank runs on {}{}: others show {} screen{}",
                 fmt::join(missing.begin(), missing.begin() + static_cast<std::ptrdiff_t>(named), ", "),
                 missing.size() > named ? fmt::format(" and {} more hosts", missing.size() - named) : "", homeless,
                 homeless == 1 ? "" : "s");
  }
  return owners;
}

}  // namespace hpr
