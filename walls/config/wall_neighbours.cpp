#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <tuple>

#include "walls/config/wall_draft.h"
#include "walls/geometry/geometry.h"
#include "walls/geometry/planar.h"

namespace hpr {
namespace {

/// One warning per screen that differs is enough; a grid's screens stand in one line of the file, and get one in all.
class NeighbourWarnings {
 public:
  explicit NeighbourWarnings(Findings& findings) : findings_(findings) {}

  void add(TextPlace place, std::string_view what, std::string_view about, std::string hint) {
    if (!told_.insert({place.line, place.column, std::string(what)}).second) return;
    findings_.warning(place, about, std::move(hint));
  }

 private:
  Findings& findings_;
  std::set<std::tuple<int, int, std::string>> told_;
};

void compare_pixels(const DraftScreen& a, const DraftScreen& b, NeighbourWarnings& warnings) {
  constexpr double kAlike = 0.005;
  const double first = pixel_pitch(a.screen);
  const double second = pixel_pitch(b.screen);
  if (std::abs(first / second - 1.0) <= kAlike) return;
  warnings.add(b.place, "pitch",
               fmt::format(R"(screens "{}" and "{}" are neighbours with pixels of {:.4g} and {:.4g} mm)", a.screen.id,
                           b.screen.id, 1000.0 * first, 1000.0 * second),
               "right where the panels differ; else check pixels and metres of the lit area");
}

/// Both fade, or the overlap is brighter than the rest.
void compare_blends(const DraftScreen& a, const DraftScreen& b, double overlap, NeighbourWarnings& warnings) {
  if (a.screen.blend.any() == b.screen.blend.any()) return;
  const DraftScreen& plain = a.screen.blend.any() ? b : a;
  const DraftScreen& faded = a.screen.blend.any() ? a : b;
  warnings.add(plain.place, "blend",
               fmt::format(R"(screen "{}" overlaps "{}" by {:.4g} mm and does not fade its edge as that one does)",
                           plain.screen.id, faded.screen.id, 1000.0 * overlap),
               "add edge_blend_m = \"auto\" to both");
}

/// A width is taken at its word, whatever lies there; that may be nothing.
void look_for_overlap(const DraftScreen& draft, bool overlaps, NeighbourWarnings& warnings) {
  const EdgeBlend& blend = draft.screen.blend;
  if (overlaps || blend.automatic || !blend.any()) return;
  warnings.add(
      draft.place, "alone",
      fmt::format("screen \"{}\" fades its edges and overlaps no screen of its plane", draft.screen.id),
      "This is right where something else shines there; else use edge_blend_m = \"auto\", which fades overlaps alone");
}

}  // namespace

void warn_about_neighbours(const WallDraft& draft, Findings& findings) {
  constexpr double kReach = 0.1;  // of a screen: farther apart they are not seen as one picture
  std::vector<WallScreen> screens;
  for (const DraftScreen& screen : draft.screens) screens.push_back(screen.screen);
  NeighbourWarnings warnings(findings);
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
    const double shared = shared_metres(*box, screens[i]);
    if (shared < -kReach * size) continue;
    compare_pixels(draft.screens[i], draft.screens[j], warnings);
    if (!(shared > 1e-6 * size)) continue;
    compare_blends(draft.screens[i], draft.screens[j], shared, warnings);
    overlaps[i] = overlaps[j] = true;
  }
  for (std::size_t i = 0; i < screens.size(); ++i) look_for_overlap(draft.screens[i], overlaps[i], warnings);
}

}  // namespace hpr
