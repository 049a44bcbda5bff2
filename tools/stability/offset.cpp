#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "tools/stability/cases.h"
#include "tools/stability/exhibits.h"
#include "tools/stability/tools.h"

namespace hpr::stability {
namespace {

constexpr double kPromised = 1e7;
constexpr double kPixelsPerMetre = 90.0;  // of the nearest exhibit: 192 / (2 tan 0.4) pixels a metre, 2.5 m away
constexpr double kSnap = 1.0 / 256.0;     // pixels: where OpenGL puts corners
constexpr double kFarthest = 1e17;

glm::dvec3 offset_by(double metres) {
  return {std::floor(metres), 0.0, -std::floor(metres)};
}

View moved(View view, double metres) {
  view.eye += offset_by(metres);
  return view;
}

/// The share of pixels an edge that moves by up to `pixels` can change, where a share `edges` of pixels has edges.
double share_moved(double edges, double pixels) {
  return std::min(1.0, edges * 2.0 * (pixels + kSnap));
}

/// The pixels whose keys are not the same to the bit.
std::size_t differing_keys(const Image<Key>& a, const Image<Key>& b) {
  std::size_t found = 0;
  for (std::size_t i = 0; i < a.pixels().size(); ++i) found += a.pixels()[i] == b.pixels()[i] ? 0U : 1U;
  return found;
}

/// Where all places are multiples of 2^-10 m, and the offset of whole metres, sums in double are exact.
StabilityFinding exact_places(Drawer& drawer) {
  constexpr double kSteps = 1024.0;
  const Scene scene = exhibits(kSteps);
  const Image<Key> expected = drawer.draw(scene, exhibits_view(kSteps));
  const auto differing = [&](double metres) {
    Scene other = scene;
    move_placements(other, offset_by(metres));
    return static_cast<double>(differing_keys(expected, drawer.draw(other, moved(exhibits_view(kSteps), metres))));
  };
  StabilityFinding finding;
  finding.name = "offset/exact-places";
  finding.parameter = "places at multiples of 2^-10 m, scene and eye moved by (D, 0, -D), D up to 1e7 m";
  finding.unit = "pixels whose keys differ";
  finding.why = "Sums of such places are exact in double below 2^43 m, and GL sees their differences only.";
  finding.curve.x = "D, m";
  for (int power = 0; power <= 16; ++power) {
    const double metres = std::pow(10.0, power);
    const double share = differing(metres);
    finding.curve.points.emplace_back(metres, share);
    if (metres <= kPromised) finding.measured = std::max(finding.measured, share);
  }
  if (finding.holds()) {
    finding.breaks_at =
        breaking_point_if_any(kPromised, kFarthest, 0.05, [&](double d) { return differing(d) <= 0.0; });
  }
  return finding;
}

StabilityFinding any_places(Drawer& drawer) {
  const Scene scene = exhibits();
  const Image<Key> expected = drawer.draw(scene, exhibits_view());
  const double edge_share = edges(expected);
  const auto share = [&](double metres) {
    Scene other = scene;
    move_placements(other, offset_by(metres));
    return other_surfaces(expected, drawer.draw(other, moved(exhibits_view(), metres)));
  };
  // Scene and eye round to 2^-53 of the offset each.
  const auto bound = [&](double metres) { return share_moved(edge_share, 2.0 * 0x1p-53 * metres * kPixelsPerMetre); };
  StabilityFinding finding;
  finding.name = "offset/any-places";
  finding.parameter = "any places, scene and eye moved by (D, 0, -D), D up to 1e7 m";
  finding.unit = "share of pixels with another surface";
  finding.limit = bound(kPromised);
  finding.why = "Places round to 2^-53 D; only where that moves a corner to the next 1/256 pixel can an edge change.";
  finding.curve.x = "D, m";
  for (int power = 0; power <= 16; ++power) {
    const double metres = std::pow(10.0, power);
    finding.curve.points.emplace_back(metres, share(metres));
    finding.curve.expected.emplace_back(metres, bound(metres));
    if (metres <= kPromised) finding.measured = std::max(finding.measured, finding.curve.points.back().second);
  }
  if (finding.holds()) {
    finding.breaks_at =
        breaking_point_if_any(kPromised, kFarthest, 0.05, [&](double d) { return share(d) <= finding.limit; });
  }
  return finding;
}

StabilityFinding lit(const Globals& globals) {
  const Scene scene = exhibits();
  const Picture expected = make_picture(globals, scene, exhibits_view(), exhibits_light());
  StabilityFinding finding;
  finding.name = "offset/light";
  finding.parameter = "the same with all light, D up to 1e7 m";
  finding.unit = "share of pixels off by more than 1 level of 255";
  finding.limit = share_moved(std::max(edges(expected.keys), color_edges(expected.radiance)), 0.0);
  finding.why = "Rays start from places relative to the scene's middle: as for surfaces, only edges can change.";
  finding.curve.x = "D, m";
  for (const double metres : {1e2, 1e4, 1e5, 1e6, 1e7, 1e9}) {
    Scene other = scene;
    move_placements(other, offset_by(metres));
    const Picture found = make_picture(globals, other, moved(exhibits_view(), metres), exhibits_light());
    const double share = other_colors(expected.radiance, found.radiance);
    finding.curve.points.emplace_back(metres, share);
    if (metres <= kPromised) finding.measured = std::max(finding.measured, share);
  }
  return finding;
}

StabilityFinding baked(Drawer& drawer) {
  constexpr double kPromisedBaked = 1e3;
  const Image<Key> expected = drawer.draw(exhibits(), exhibits_view());
  const double edge_share = edges(expected);
  const auto share = [&](double metres) {
    Scene other = exhibits();
    move_vertices(other, offset_by(metres));
    return other_surfaces(expected, drawer.draw(other, moved(exhibits_view(), metres)));
  };
  const auto bound = [&](double metres) {
    // Two rounded coordinates, and as much again where the matrix multiplies them and takes the offset off.
    return share_moved(edge_share, 2.0 * std::sqrt(2.0) * 2.0 * kFloatRounding * metres * kPixelsPerMetre);
  };
  StabilityFinding finding;
  finding.name = "offset/baked-vertices";
  finding.parameter = "offset in the vertices, which are floats: D up to 1e3 m";
  finding.unit = "share of pixels with another surface";
  finding.limit = bound(kPromisedBaked);
  finding.why = "Vertices round to 2^-24 D, before HPR sees them, and again when the eye is taken off.";
  finding.curve.x = "D, m";
  for (double metres = 1.0; metres < 2e8; metres *= std::sqrt(10.0)) {
    finding.curve.points.emplace_back(metres, share(metres));
    finding.curve.expected.emplace_back(metres, bound(metres));
    if (metres <= kPromisedBaked * 1.001) {
      finding.measured = std::max(finding.measured, finding.curve.points.back().second);
    }
  }
  if (finding.holds()) {
    finding.breaks_at =
        breaking_point_if_any(kPromisedBaked, 1e9, 0.05, [&](double d) { return share(d) <= finding.limit; });
  }
  return finding;
}

}  // namespace

std::vector<StabilityFinding> offset(const Globals& globals) {
  Drawer drawer(globals);
  return {exact_places(drawer), any_places(drawer), lit(globals), baked(drawer)};
}

}  // namespace hpr::stability
