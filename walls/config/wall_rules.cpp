#include <fmt/format.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <map>
#include <numeric>
#include <set>

#include "core/text.h"
#include "walls/config/wall_draft.h"
#include "walls/config/wall_file.h"
#include "walls/geometry/stereo.h"

namespace hpr {
namespace {

std::string offered(std::string_view name, std::vector<std::string> ids, std::string_view none) {
  return ids.empty() ? std::string(none) : unknown_name_hint(name, ids);
}

/// The checks of one draft; each member function is one of them.
class Linker {
 public:
  Linker(WallDraft& draft, Findings& findings) : draft_(draft), findings_(findings) {}

  /// False: there is too much of something to check more.
  bool run() {
    check_counts();
    if (too_many_) return false;
    check_node_ids();
    link_windows();
    check_ranks();
    check_window_overlaps();
    link_screens();
    check_screen_ids();
    check_shared_windows();
    check_same_places();
    warn_about_idle_windows();
    return true;
  }

 private:
  void check_counts() {
    const auto most = static_cast<std::size_t>(kMaxScreens);
    const std::size_t largest = std::max({draft_.nodes.size(), draft_.windows.size(), draft_.screens.size(),
                                          draft_.surfaces.size(), draft_.viewers.size(), draft_.monitors.size()});
    too_many_ = largest > most;
    if (!too_many_) return;
    findings_.error(
        {},
        fmt::format("the wall has {} nodes, {} windows, {} screens, {} surfaces, {} viewers and {} monitors",
                    draft_.nodes.size(), draft_.windows.size(), draft_.screens.size(), draft_.surfaces.size(),
                    draft_.viewers.size(), draft_.monitors.size()),
        fmt::format("it may have {} of each", kMaxScreens));
  }

  void check_node_ids() {
    std::map<std::string, TextPlace> seen;
    for (const DraftNode& draft : draft_.nodes) {
      const std::string& id = draft.node.id;
      if (!id.empty() && !seen.emplace(id, draft.place).second) {
        findings_.error(draft.place, fmt::format("there are two nodes \"{}\"", id),
                        fmt::format("the other is in line {}; give each its own id", seen[id].line));
      }
    }
  }

  void link_windows() {
    std::map<std::string, TextPlace> seen;
    for (DraftWindow& draft : draft_.windows) {
      WallWindow& window = draft.window;
      if (!window.id.empty() && !seen.emplace(window.id, draft.place).second) {
        findings_.error(draft.place, fmt::format("there are two windows \"{}\"", window.id),
                        fmt::format("the other is in line {}; give each its own id", seen[window.id].line));
      }
      link_to_node(draft);
      windows_.emplace(window.id, &draft);
    }
  }

  void link_to_node(DraftWindow& draft) {
    WallWindow& window = draft.window;
    if (window.node.empty() && draft_.nodes.size() == 1) window.node = draft_.nodes.front().node.id;
    if (window.node.empty() && draft_.nodes.size() > 1) {
      findings_.error(draft.place, fmt::format("window \"{}\" names no node", window.id), "add node = \"...\"");
    }
    if (window.node.empty()) return;
    const auto node = std::ranges::find(draft_.nodes, window.node, [](const DraftNode& n) { return n.node.id; });
    if (node == draft_.nodes.end()) {
      std::vector<std::string> ids;
      for (const DraftNode& n : draft_.nodes) ids.push_back(n.node.id);
      findings_.error(
          draft.node_place,
          fmt::format(R"(window "{}" is on node "{}", which does not exist)", window.id, printable(window.node)),
          offered(window.node, ids, "the wall has no nodes"));
      return;
    }
    const std::vector<std::string>& gpus = node->node.gpus;
    if (window.gpu.empty() || std::ranges::find(gpus, window.gpu) != gpus.end()) return;
    findings_.error(draft.gpu_place,
                    fmt::format(R"(window "{}" is on gpu "{}", which node "{}" does not have)", window.id,
                                printable(window.gpu), window.node),
                    offered(window.gpu, gpus, "the node lists no gpus"));
  }

  void check_ranks() {
    const auto ranks_of = [](std::int64_t sum, const DraftNode& n) { return sum + n.node.ranks; };
    const bool all_counted =
        !draft_.nodes.empty() && std::ranges::all_of(draft_.nodes, [](const DraftNode& n) { return n.node.ranks > 0; });
    const std::int64_t ranks = std::accumulate(draft_.nodes.begin(), draft_.nodes.end(), std::int64_t{0}, ranks_of);
    std::map<int, const DraftWindow*> owners;
    for (const DraftWindow& draft : draft_.windows) {
      const int rank = draft.window.rank;
      if (rank < 0) continue;
      if (all_counted && rank >= ranks) {
        findings_.error(draft.rank_place,
                        fmt::format("window \"{}\" wants rank {} of {}", draft.window.id, rank, ranks),
                        fmt::format("ranks count from 0 over the whole job: 0 to {}", ranks - 1));
      }
      const DraftWindow* const other = owners.emplace(rank, &draft).first->second;
      if (other->window.node != draft.window.node) {
        findings_.error(draft.rank_place,
                        fmt::format(R"(rank {} is wanted on two nodes, "{}" and "{}")", rank, other->window.node,
                                    draft.window.node),
                        "ranks count from 0 over the whole job; a rank runs on one node");
      }
    }
  }

  void check_window_overlaps() {
    for (std::size_t i = 0; i < draft_.windows.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        const WallWindow& a = draft_.windows[j].window;
        const WallWindow& b = draft_.windows[i].window;
        if (a.id == b.id || a.node != b.node || a.display != b.display || a.gpu != b.gpu) continue;
        const Rect both = intersection(a.rect, b.rect);
        if (a.rect.empty() || b.rect.empty() || both.empty()) continue;
        findings_.error(
            draft_.windows[i].place,
            fmt::format(R"(tile driven twice: windows "{}" and "{}" overlap by {} x {} pixels on one display)", a.id,
                        b.id, both.width(), both.height()),
            "move one of them: rect = [x, y, width, height]");
      }
    }
  }

  void link_screens() {
    for (DraftScreen& draft : draft_.screens) {
      WallScreen& screen = draft.screen;
      const Size shown = panel_pixels(screen);
      const bool placed = !screen.viewport.empty();
      placed_.push_back(placed);
      if (!placed) screen.viewport = {0, 0, shown.width, shown.height};
      if (screen.window.empty()) continue;
      const auto found = windows_.find(screen.window);
      if (found == windows_.end()) {
        std::vector<std::string> ids;
        for (const auto& [id, window] : windows_) ids.push_back(id);
        findings_.error(draft.window_place,
                        fmt::format(R"(screen "{}" is shown in window "{}", which does not exist)", screen.id,
                                    printable(screen.window)),
                        offered(screen.window, ids, "the wall has no windows"));
        continue;
      }
      const WallWindow& window = found->second->window;
      screen.node = window.node;
      screen.rank = window.rank;
      check_viewport(draft, window, shown, placed);
    }
  }

  void check_viewport(const DraftScreen& draft, const WallWindow& window, Size shown, bool placed) {
    const WallScreen& screen = draft.screen;
    const Rect& viewport = screen.viewport;
    if (shown.area() == 0) return;
    if (viewport.width() != shown.width || viewport.height() != shown.height) {
      findings_.error(draft.place,
                      fmt::format("screen \"{}\" shows {} x {} pixels in a viewport of {} x {}", screen.id, shown.width,
                                  shown.height, viewport.width(), viewport.height()),
                      "pixels are of the upright picture; the viewport's sides are swapped when rotate is 90 or 270");
    }
    if (window.rect.empty()) return;
    const Rect inside{0, 0, window.rect.width(), window.rect.height()};
    const bool fills = viewport == inside;
    if (placed ? intersection(viewport, inside) == viewport : fills) return;
    findings_.error(draft.place,
                    fmt::format(R"(screen "{}" needs {} x {} pixels at ({}, {}) of window "{}", which has {} x {})",
                                screen.id, viewport.width(), viewport.height(), viewport.x0, viewport.y0, window.id,
                                inside.width(), inside.height()),
                    "give the window that size, or the screen a viewport = [x, y, width, height] inside it");
  }

  void check_screen_ids() {
    std::map<std::string, const DraftScreen*> seen;
    for (const DraftScreen& draft : draft_.screens) {
      const std::string& id = draft.screen.id;
      if (id.empty()) continue;
      check_file_name(id, draft.place, findings_);
      const auto [other, fresh] = seen.emplace(id, &draft);
      if (fresh) continue;
      const WallScreen& first = other->second->screen;
      const bool two_nodes = first.node != draft.screen.node;
      findings_.error(draft.place,
                      two_nodes ? fmt::format(R"(screen "{}" is driven by two nodes, "{}" and "{}")", id, first.node,
                                              draft.screen.node)
                                : fmt::format("there are two screens \"{}\"", id),
                      fmt::format("the other is in line {}; give each its own id", other->second->place.line));
    }
  }

  void check_shared_windows() {
    std::map<std::string, std::vector<std::size_t>> shown;
    for (std::size_t i = 0; i < draft_.screens.size(); ++i) {
      const DraftScreen& draft = draft_.screens[i];
      if (draft.screen.window.empty()) continue;
      std::vector<std::size_t>& others = shown[draft.screen.window];
      for (const std::size_t j : others) {
        const WallScreen& other = draft_.screens[j].screen;
        if (intersection(other.viewport, draft.screen.viewport).empty()) continue;
        const bool told = placed_[i] && placed_[j];
        findings_.error(
            draft.window_place,
            fmt::format(R"(tile driven twice: window "{}" shows screens "{}" and "{}"{})", draft.screen.window,
                        other.id, draft.screen.id, told ? " in overlapping viewports" : ""),
            "give each screen its own window, or its own viewport = [x, y, width, height] in it");
        break;
      }
      others.push_back(i);
    }
  }

  void check_same_places() {
    for (std::size_t i = 0; i < draft_.screens.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        const DraftScreen& a = draft_.screens[j];
        const DraftScreen& b = draft_.screens[i];
        if (!a.has_corners || !b.has_corners || a.screen.id == b.screen.id) continue;
        if (for_other_eyes(a.screen, b.screen) || a.screen.warp.points || b.screen.warp.points) continue;
        const double near_enough = 1e-6 * screen_width(a.screen);
        const bool same = glm::distance(a.screen.lower_left, b.screen.lower_left) < near_enough &&
                          glm::distance(a.screen.lower_right, b.screen.lower_right) < near_enough &&
                          glm::distance(a.screen.upper_left, b.screen.upper_left) < near_enough;
        if (!same) continue;
        findings_.error(
            b.place,
            fmt::format(R"(tile driven twice: screens "{}" and "{}" are the same rectangle)", a.screen.id, b.screen.id),
            R"(remove one, or give one eye = "left" and the other eye = "right")");
      }
    }
  }

  /// Only of a wall without errors: a screen that could not be read cannot name its window.
  void warn_about_idle_windows() {
    if (findings_.any_errors()) return;
    std::set<std::string> used;
    for (const DraftScreen& draft : draft_.screens) used.insert(draft.screen.window);
    for (const DraftWindow& draft : draft_.windows) {
      if (draft.window.id.empty() || used.contains(draft.window.id)) continue;
      findings_.warning(draft.place, fmt::format("window \"{}\" shows no screen", draft.window.id),
                        "remove it, or name it in a screen or a grid's windows");
    }
  }

  WallDraft& draft_;
  Findings& findings_;
  bool too_many_ = false;
  std::map<std::string, const DraftWindow*> windows_;
  std::vector<bool> placed_;  ///< per screen: it has a viewport in the file
};

}  // namespace

void check_file_name(const std::string& id, const TextPlace& place, Findings& findings) {
  if (id == "wall") {
    findings.error(place, "a picture must not be called \"wall\"", "wall.png is the picture of the whole wall");
  } else if (id.ends_with(".panel")) {
    findings.error(place, fmt::format("\"{}\" ends as the pictures of panels do", id),
                   "what a turned panel is sent is in SCREEN.panel.png: leave out the .panel");
  }
}

bool link_wall(WallDraft& draft, Findings& findings) {
  return Linker(draft, findings).run();
}

}  // namespace hpr
