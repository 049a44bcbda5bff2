#include <fmt/format.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/text.h"
#include "walls/config/wall_draft.h"
#include "walls/geometry/geometry.h"

namespace hpr {
namespace {

void check_viewers(WallDraft& draft, Findings& findings) {
  std::set<std::string> seen;
  for (const DraftViewer& viewer : draft.viewers) {
    const WallViewer& v = viewer.viewer;
    if (draft.viewers.size() == 1) {
      if (v.tracker.kind != WallTracker::Kind::None && !viewer.placed) {
        findings.error(viewer.place, "a viewer who moves has no position_m",
                       "add position_m = [x, y, z]: where the head rests, which is where the scene's camera is");
      }
      return;
    }
    if (v.id.empty()) findings.error(viewer.place, "one of several viewers has no 'id'", "add id = \"left-seat\"");
    if (!viewer.placed) {
      findings.error(viewer.place, fmt::format("viewer \"{}\" of several has no position_m", v.id),
                     "add position_m = [x, y, z]");
    }
    if (!v.id.empty() && !seen.insert(v.id).second) {
      findings.error(viewer.place, fmt::format("there are two viewers \"{}\"", v.id), "give each its own id");
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
      surface.viewer_place,
      fmt::format(R"(surface "{}" is seen by viewer "{}", who does not exist)", surface.id, printable(surface.viewer)),
      ids.empty() ? "the wall has no viewer with an id" : unknown_name_hint(surface.viewer, ids));
  return std::nullopt;
}

void link_surfaces(WallDraft& draft, Findings& findings) {
  std::set<std::string> watched;
  std::set<std::string> seen;
  for (const DraftSurface& surface : draft.surfaces) {
    if (!seen.insert(surface.id).second) {
      findings.error(surface.place, fmt::format("there are two surfaces \"{}\"", surface.id), "give each its own id");
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
    findings.warning(idle.place, fmt::format("no surface is seen by viewer \"{}\"", idle.viewer.id),
                     "name them in a surface: viewer = \"...\"; all others are seen by the first");
  }
}

void check_stereo(const WallDraft& draft, Findings& findings) {
  if (draft.stereo == StereoMode::None) return;
  const auto two_pictures = [](const DraftScreen& s) { return s.screen.eye == Eye::Both; };
  const bool any_for_both = std::ranges::any_of(draft.screens, two_pictures);
  if (draft.stereo == StereoMode::Passive && any_for_both) {
    findings.warning(draft.stereo_place, "stereo is passive, and screens without an eye show one picture for both",
                     R"(add eye = "left" or eye = "right" to each screen, or choose another mode)");
  }
  if (draft.stereo != StereoMode::Passive && !any_for_both && !draft.screens.empty()) {
    findings.warning(draft.stereo_place, "all screens are for one eye, so the stereo mode changes nothing",
                     "write mode = \"passive\", or remove the screens' eyes");
  }
  const bool apart = std::ranges::any_of(draft.viewers, [](const DraftViewer& v) { return v.viewer.ipd_m > 0.0; });
  if (!apart) {
    findings.warning(draft.stereo_place, "both eyes see the same: no viewer has an ipd_m",
                     "add ipd_m = 0.063 to the viewer");
  }
  const bool two_on_a_panel = draft.stereo == StereoMode::SideBySide || draft.stereo == StereoMode::TopBottom;
  for (const DraftScreen& turned : draft.screens) {
    const int rotate = turned.screen.rotate;
    if (!two_on_a_panel || turned.screen.eye != Eye::Both || rotate % 180 == 0) continue;
    findings.error(turned.place,
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
      findings.error(draft_screen.place, fmt::format("screen \"{}\" has one pixel for two eyes", screen.id),
                     "give it more pixels, or choose another stereo mode");
    }
  }
}

void check_monitors(WallDraft& draft, Findings& findings) {
  std::set<std::string> taken;
  for (const DraftScreen& screen : draft.screens) taken.insert(screen.screen.id);
  std::vector<std::string> surfaces;
  for (const DraftSurface& surface : draft.surfaces) surfaces.push_back(surface.id);
  for (DraftMonitor& draft_monitor : draft.monitors) {
    WallMonitor& monitor = draft_monitor.monitor;
    if (!monitor.id.empty() && !taken.insert(monitor.id).second) {
      findings.error(draft_monitor.place, fmt::format("monitor \"{}\" is called as something else", monitor.id),
                     "its picture is a file beside the screens': give it its own id");
    }
    check_file_name(monitor.id, draft_monitor.place, findings);
    if (monitor.surface.empty() && surfaces.size() == 1) monitor.surface = surfaces.front();
    if (std::ranges::find(surfaces, monitor.surface) != surfaces.end()) continue;
    findings.error(draft_monitor.surface_place,
                   monitor.surface.empty() ? fmt::format("monitor \"{}\" names no surface", monitor.id)
                                           : fmt::format(R"(monitor "{}" shows surface "{}", which does not exist)",
                                                         monitor.id, printable(monitor.surface)),
                   surfaces.empty() ? "the wall has no surfaces" : unknown_name_hint(monitor.surface, surfaces));
  }
}

}  // namespace

void link_viewers(WallDraft& draft, Findings& findings) {
  check_viewers(draft, findings);
  link_surfaces(draft, findings);
  check_stereo(draft, findings);
  check_monitors(draft, findings);
}

void warn_about_viewers(const WallDraft& draft, Findings& findings) {
  for (std::size_t i = 0; i < draft.viewers.size(); ++i) {
    const WallViewer& viewer = draft.viewers[i].viewer;
    if (!viewer.given) continue;
    for (const DraftScreen& one : draft.screens) {
      const WallScreen& screen = one.screen;
      if (screen.viewer != i || screen.warp.points) continue;
      const double before =
          glm::dot(viewer.position + viewer.eye_offset - screen_center(screen), screen_axes(screen)[2]);
      if (before > 0.0) continue;
      findings.warning(
          draft.viewers[i].place,
          fmt::format("viewer {}stands behind screen \"{}\"",
                      viewer.id.empty() ? "" : fmt::format("\"{}\" ", viewer.id), screen.id),
          fmt::format("its picture is made for an eye {:g} m before it; see the sign of position_m, and the "
                      "order of the screen's corners",
                      viewer.clamp_distance_m));
      break;
    }
  }
}

}  // namespace hpr
