#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "core/text.h"
#include "walls/config/wall_draft.h"
#include "walls/config/wall_file.h"
#include "walls/geometry/geometry.h"
#include "walls/geometry/neighbors.h"

namespace hpr {
namespace {

std::string offered(std::string_view name, std::vector<std::string> ids, std::string_view none) {
  return ids.empty() ? std::string(none) : unknown_name_hint(name, ids);
}

/// Adds a finding where `id` cannot be a picture's name.
void check_file_name(const std::string& id, const TextPosition& position, Findings& findings) {
  if (id == "wall") {
    findings.error(position, "a picture must not be called \"wall\"", "wall.png is the picture of the whole wall");
  } else if (id.ends_with(".panel")) {
    findings.error(position, fmt::format("\"{}\" ends as the pictures of panels do", id),
                   "what a turned panel is sent is in SCREEN.panel.png: leave out the .panel");
  }
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
    std::map<std::string, TextPosition> seen;
    for (const DraftNode& draft : draft_.nodes) {
      const std::string& id = draft.node.id;
      if (!id.empty() && !seen.emplace(id, draft.position).second) {
        findings_.error(draft.position, fmt::format("there are two nodes \"{}\"", id),
                        fmt::format("the other is in line {}; give each its own id", seen[id].line));
      }
    }
  }

  void link_windows() {
    std::map<std::string, TextPosition> seen;
    for (DraftWindow& draft : draft_.windows) {
      WallWindow& window = draft.window;
      if (!window.id.empty() && !seen.emplace(window.id, draft.position).second) {
        findings_.error(draft.position, fmt::format("there are two windows \"{}\"", window.id),
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
      findings_.error(draft.position, fmt::format("window \"{}\" names no node", window.id), "add node = \"...\"");
    }
    if (window.node.empty()) return;
    const auto node = std::ranges::find(draft_.nodes, window.node, [](const DraftNode& n) { return n.node.id; });
    if (node == draft_.nodes.end()) {
      std::vector<std::string> ids;
      for (const DraftNode& n : draft_.nodes) ids.push_back(n.node.id);
      findings_.error(
          draft.node_position,
          fmt::format(R"(window "{}" is on node "{}", which does not exist)", window.id, printable(window.node)),
          offered(window.node, ids, "the wall has no nodes"));
      return;
    }
    const std::vector<std::string>& gpus = node->node.gpus;
    if (window.gpu.empty() || std::ranges::find(gpus, window.gpu) != gpus.end()) return;
    findings_.error(draft.gpu_position,
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
        findings_.error(draft.rank_position,
                        fmt::format("window \"{}\" wants rank {} of {}", draft.window.id, rank, ranks),
                        fmt::format("ranks count from 0 over the whole job: 0 to {}", ranks - 1));
      }
      const DraftWindow* const other = owners.emplace(rank, &draft).first->second;
      if (other->window.node != draft.window.node) {
        findings_.error(draft.rank_position,
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
            draft_.windows[i].position,
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
        findings_.error(draft.window_position,
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
      findings_.error(draft.position,
                      fmt::format("screen \"{}\" shows {} x {} pixels in a viewport of {} x {}", screen.id, shown.width,
                                  shown.height, viewport.width(), viewport.height()),
                      "pixels are of the upright picture; the viewport's sides are swapped when rotate is 90 or 270");
    }
    if (window.rect.empty()) return;
    const Rect inside{0, 0, window.rect.width(), window.rect.height()};
    const bool fills = viewport == inside;
    if (placed ? intersection(viewport, inside) == viewport : fills) return;
    findings_.error(draft.position,
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
      check_file_name(id, draft.position, findings_);
      const auto [other, fresh] = seen.emplace(id, &draft);
      if (fresh) continue;
      const WallScreen& first = other->second->screen;
      const bool two_nodes = first.node != draft.screen.node;
      findings_.error(draft.position,
                      two_nodes ? fmt::format(R"(screen "{}" is driven by two nodes, "{}" and "{}")", id, first.node,
                                              draft.screen.node)
                                : fmt::format("there are two screens \"{}\"", id),
                      fmt::format("the other is in line {}; give each its own id", other->second->position.line));
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
        const bool both_placed = placed_[i] && placed_[j];
        findings_.error(
            draft.window_position,
            fmt::format(R"(tile driven twice: window "{}" shows screens "{}" and "{}"{})", draft.screen.window,
                        other.id, draft.screen.id, both_placed ? " in overlapping viewports" : ""),
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
            b.position,
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
      findings_.warning(draft.position, fmt::format("window \"{}\" shows no screen", draft.window.id),
                        "remove it, or name it in a screen or a grid's windows");
    }
  }

  WallDraft& draft_;
  Findings& findings_;
  bool too_many_ = false;
  std::map<std::string, const DraftWindow*> windows_;
  std::vector<bool> placed_;  ///< per screen: it has a viewport in the file
};

void check_viewers(WallDraft& draft, Findings& findings) {
  std::set<std::string> seen;
  for (const DraftViewer& viewer : draft.viewers) {
    const WallViewer& v = viewer.viewer;
    if (draft.viewers.size() == 1) {
      if (v.tracker.kind != WallTracker::Kind::None && !viewer.placed) {
        findings.error(viewer.position, "a viewer who moves has no position_m",
                       "add position_m = [x, y, z]: where the head rests, which is where the scene's camera is");
      }
      return;
    }
    if (v.id.empty()) findings.error(viewer.position, "one of several viewers has no 'id'", "add id = \"left-seat\"");
    if (!viewer.placed) {
      findings.error(viewer.position, fmt::format("viewer \"{}\" of several has no position_m", v.id),
                     "add position_m = [x, y, z]");
    }
    if (!v.id.empty() && !seen.insert(v.id).second) {
      findings.error(viewer.position, fmt::format("there are two viewers \"{}\"", v.id), "give each its own id");
    }
  }
}

/// The index of the viewer a surface names; none, and a finding, where nobody is called so.
std::optional<std::size_t> find_viewer(const WallDraft& draft, const DraftSurface& surface, Findings& findings) {
  const auto viewer =
      std::ranges::find(draft.viewers, surface.viewer, [](const DraftViewer& v) { return v.viewer.id; });
  if (viewer != draft.viewers.end()) return static_cast<std::size_t>(viewer - draft.viewers.begin());
  std::vector<std::string> ids;
  for (const DraftViewer& v : draft.viewers) {
    if (!v.viewer.id.empty()) ids.push_back(v.viewer.id);
  }
  findings.error(
      surface.viewer_position,
      fmt::format(R"(surface "{}" is seen by viewer "{}", who does not exist)", surface.id, printable(surface.viewer)),
      ids.empty() ? "the wall has no viewer with an id" : unknown_name_hint(surface.viewer, ids));
  return std::nullopt;
}

void link_surfaces(WallDraft& draft, Findings& findings) {
  std::set<std::string> watched;
  std::set<std::string> seen;
  for (const DraftSurface& surface : draft.surfaces) {
    if (!seen.insert(surface.id).second) {
      findings.error(surface.position, fmt::format("there are two surfaces \"{}\"", surface.id),
                     "give each its own id");
    }
    if (surface.viewer.empty()) continue;
    const auto viewer = find_viewer(draft, surface, findings);
    if (!viewer) continue;
    watched.insert(surface.viewer);
    for (DraftScreen& screen : draft.screens) {
      if (screen.screen.surface == surface.id) screen.screen.viewer = *viewer;
    }
  }
  for (std::size_t i = 1; i < draft.viewers.size(); ++i) {
    const DraftViewer& idle = draft.viewers[i];
    if (idle.viewer.id.empty() || watched.contains(idle.viewer.id)) continue;
    findings.warning(idle.position, fmt::format("no surface is seen by viewer \"{}\"", idle.viewer.id),
                     "name them in a surface: viewer = \"...\"; all others are seen by the first");
  }
}

void check_stereo(const WallDraft& draft, Findings& findings) {
  if (draft.stereo == StereoMode::None) return;
  const auto two_pictures = [](const DraftScreen& s) { return s.screen.eye == Eye::Both; };
  const bool any_for_both = std::ranges::any_of(draft.screens, two_pictures);
  if (draft.stereo == StereoMode::Passive && any_for_both) {
    findings.warning(draft.stereo_position, "stereo is passive, and screens without an eye show one picture for both",
                     R"(add eye = "left" or eye = "right" to each screen, or choose another mode)");
  }
  if (draft.stereo != StereoMode::Passive && !any_for_both && !draft.screens.empty()) {
    findings.warning(draft.stereo_position, "all screens are for one eye, so the stereo mode changes nothing",
                     "write mode = \"passive\", or remove the screens' eyes");
  }
  const bool apart = std::ranges::any_of(draft.viewers, [](const DraftViewer& v) { return v.viewer.ipd_m > 0.0; });
  if (!apart) {
    findings.warning(draft.stereo_position, "both eyes see the same: no viewer has an ipd_m",
                     "add ipd_m = 0.063 to the viewer");
  }
  const bool two_on_a_panel = draft.stereo == StereoMode::SideBySide || draft.stereo == StereoMode::TopBottom;
  for (const DraftScreen& turned : draft.screens) {
    const int rotate = turned.screen.rotate;
    if (!two_on_a_panel || turned.screen.eye != Eye::Both || rotate % 180 == 0) continue;
    findings.error(turned.position,
                   fmt::format("screen \"{}\" is turned by {} degrees, and its panel splits two eyes' pictures",
                               turned.screen.id, rotate),
                   "panels split the picture they are sent: mount this one upright, or choose another stereo mode");
  }
  const auto is_flat = [](int side) { return side < 2; };
  for (const DraftScreen& draft_screen : draft.screens) {
    const WallScreen& screen = draft_screen.screen;
    const bool beside = draft.stereo == StereoMode::SideBySide && is_flat(screen.pixels.width);
    const bool above = draft.stereo == StereoMode::TopBottom && is_flat(screen.pixels.height);
    if (screen.eye == Eye::Both && draft_screen.has_corners && (beside || above)) {
      findings.error(draft_screen.position, fmt::format("screen \"{}\" has one pixel for two eyes", screen.id),
                     "give it more pixels, or choose another stereo mode");
    }
  }
}

void check_monitors(WallDraft& draft, Findings& findings) {
  std::set<std::string> ids;
  for (const DraftScreen& screen : draft.screens) ids.insert(screen.screen.id);
  std::vector<std::string> surfaces;
  for (const DraftSurface& surface : draft.surfaces) surfaces.push_back(surface.id);
  for (DraftMonitor& draft_monitor : draft.monitors) {
    WallMonitor& monitor = draft_monitor.monitor;
    if (!monitor.id.empty() && !ids.insert(monitor.id).second) {
      findings.error(draft_monitor.position, fmt::format("monitor \"{}\" is called as something else", monitor.id),
                     "its picture is a file beside the screens': give it its own id");
    }
    check_file_name(monitor.id, draft_monitor.position, findings);
    if (monitor.surface.empty() && surfaces.size() == 1) monitor.surface = surfaces.front();
    if (std::ranges::find(surfaces, monitor.surface) != surfaces.end()) continue;
    findings.error(draft_monitor.surface_position,
                   monitor.surface.empty() ? fmt::format("monitor \"{}\" names no surface", monitor.id)
                                           : fmt::format(R"(monitor "{}" shows surface "{}", which does not exist)",
                                                         monitor.id, printable(monitor.surface)),
                   surfaces.empty() ? "the wall has no surfaces" : unknown_name_hint(monitor.surface, surfaces));
  }
}

/// One warning per screen that differs is enough; a grid's screens stand in one line of the file, and get one in all.
class NeighborWarnings {
 public:
  explicit NeighborWarnings(Findings& findings) : findings_(findings) {}

  void add(TextPosition position, std::string_view what, std::string_view about, std::string hint) {
    if (!reported_.insert({position.line, position.column, std::string(what)}).second) return;
    findings_.warning(position, about, std::move(hint));
  }

 private:
  Findings& findings_;
  std::set<std::tuple<int, int, std::string>> reported_;
};

void compare_pixels(const DraftScreen& a, const DraftScreen& b, NeighborWarnings& warnings) {
  constexpr double kAlike = 0.005;
  const double first = pixel_pitch(a.screen);
  const double second = pixel_pitch(b.screen);
  if (std::abs(first / second - 1.0) <= kAlike) return;
  warnings.add(b.position, "pitch",
               fmt::format(R"(screens "{}" and "{}" are neighbours with pixels of {:.4g} and {:.4g} mm)", a.screen.id,
                           b.screen.id, 1000.0 * first, 1000.0 * second),
               "right where the panels differ; else check pixels and metres of the lit area");
}

/// Both fade, or the overlap is brighter than the rest.
void compare_blends(const DraftScreen& a, const DraftScreen& b, double overlap, NeighborWarnings& warnings) {
  if (a.screen.blend.any() == b.screen.blend.any()) return;
  const DraftScreen& plain = a.screen.blend.any() ? b : a;
  const DraftScreen& faded = a.screen.blend.any() ? a : b;
  warnings.add(plain.position, "blend",
               fmt::format(R"(screen "{}" overlaps "{}" by {:.4g} mm and does not fade its edge as that one does)",
                           plain.screen.id, faded.screen.id, 1000.0 * overlap),
               "add edge_blend_m = \"auto\" to both");
}

/// A width is taken at its word, whatever lies there; that may be nothing.
void check_overlap(const DraftScreen& draft, bool overlaps, NeighborWarnings& warnings) {
  const EdgeBlend& blend = draft.screen.blend;
  if (overlaps || blend.automatic || !blend.any()) return;
  warnings.add(
      draft.position, "alone",
      fmt::format("screen \"{}\" fades its edges and overlaps no screen of its plane", draft.screen.id),
      "This is right where something else shines there; else use edge_blend_m = \"auto\", which fades overlaps alone");
}

}  // namespace

bool link_wall(WallDraft& draft, Findings& findings) {
  return Linker(draft, findings).run();
}

void link_viewers(WallDraft& draft, Findings& findings) {
  check_viewers(draft, findings);
  link_surfaces(draft, findings);
  check_stereo(draft, findings);
  check_monitors(draft, findings);
}

void warn_about_viewers(const WallDraft& draft, Findings& findings) {
  for (std::size_t i = 0; i < draft.viewers.size(); ++i) {
    const WallViewer& viewer = draft.viewers[i].viewer;
    if (!viewer.has_position) continue;
    for (const DraftScreen& one : draft.screens) {
      const WallScreen& screen = one.screen;
      if (screen.viewer != i || screen.warp.points) continue;
      const double before =
          glm::dot(viewer.position + viewer.eye_offset - screen_center(screen), screen_axes(screen)[2]);
      if (before > 0.0) continue;
      findings.warning(
          draft.viewers[i].position,
          fmt::format("viewer {}stands behind screen \"{}\"",
                      viewer.id.empty() ? "" : fmt::format("\"{}\" ", viewer.id), screen.id),
          fmt::format("its picture is made for an eye {:g} m before it; see the sign of position_m, and the "
                      "order of the screen's corners",
                      viewer.clamp_distance_m));
      break;
    }
  }
}

void warn_about_neighbors(const WallDraft& draft, Findings& findings) {
  constexpr double kReach = 0.1;  // of a screen: farther apart they are not seen as one picture
  std::vector<WallScreen> screens;
  for (const DraftScreen& screen : draft.screens) screens.push_back(screen.screen);
  NeighborWarnings warnings(findings);
  std::vector<bool> overlaps(screens.size(), false);
  for (const auto& [i, j] : close_pairs(screens, kReach)) {
    const auto box = seen_from(screens[j], screens[i]);
    if (!box) {
      // Where a wall bends from one to the other they may.
      const bool seen_together = screens[i].eye == screens[j].eye && screens[i].viewer == screens[j].viewer;
      if (seen_together) overlaps[i] = overlaps[j] = true;
      continue;
    }
    const double size = std::min(screen_width(screens[i]), screen_height(screens[i]));
    const double shared = overlap_meters(*box, screens[i]);
    if (shared < -kReach * size) continue;
    compare_pixels(draft.screens[i], draft.screens[j], warnings);
    if (!(shared > 1e-6 * size)) continue;
    compare_blends(draft.screens[i], draft.screens[j], shared, warnings);
    overlaps[i] = overlaps[j] = true;
  }
  for (std::size_t i = 0; i < screens.size(); ++i) check_overlap(draft.screens[i], overlaps[i], warnings);
}

}  // namespace hpr
