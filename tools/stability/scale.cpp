#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include "tools/stability/cases.h"
#include "tools/stability/exhibits.h"
#include "tools/stability/tools.h"

namespace hpr::stability {
namespace {

using ScaleScene = void (*)(Scene&, double);

Picture scaled_picture(const Globals& globals, ScaleScene scale, double factor) {
  Scene scene = exhibits();
  View view = exhibits_view();
  scale(scene, factor);
  scale_view(view, factor);
  return make_picture(globals, scene, view, exhibits_light());
}

/// Pixels of which a bit differs, of key or colour.
std::size_t differing_bits(const Picture& a, const Picture& b) {
  using Bits = std::array<std::byte, sizeof(Rgb)>;
  std::size_t found = 0;
  for (std::size_t i = 0; i < a.keys.pixels().size(); ++i) {
    const bool same = a.keys.pixels()[i] == b.keys.pixels()[i] &&
                      std::bit_cast<Bits>(a.radiance.pixels()[i]) == std::bit_cast<Bits>(b.radiance.pixels()[i]);
    found += same ? 0U : 1U;
  }
  return found;
}

StabilityFinding powers_of_two(const Globals& globals, const Picture& expected, ScaleScene scale, const char* name,
                               const char* what) {
  StabilityFinding finding;
  finding.name = name;
  finding.parameter = std::string(what) + " scaled by 2^-20 .. 2^20";
  finding.unit = "pixels of which a bit of key or colour differs";
  finding.why = "Scaling by a power of two rounds nothing, so only an absolute length somewhere could show.";
  finding.curve.x = "scale";
  for (const int power : {-20, -14, -7, -1, 1, 7, 14, 20}) {
    const double factor = std::ldexp(1.0, power);
    const auto differing = static_cast<double>(differing_bits(expected, scaled_picture(globals, scale, factor)));
    finding.curve.points.emplace_back(factor, differing);
    finding.measured = std::max(finding.measured, differing);
  }
  return finding;
}

std::vector<StabilityFinding> powers_of_ten(const Globals& globals, const Picture& expected) {
  // An edge moves to the next 1/256 pixel at the most.
  constexpr double kMoved = 2.0 / 256.0;
  StabilityFinding surfaces;
  surfaces.name = "scale/surfaces";
  surfaces.parameter = "scene, eye and lights scaled by 1e-6 .. 1e6";
  surfaces.unit = "share of pixels with another surface";
  surfaces.limit = kMoved * edges(expected.keys);
  surfaces.why = "Matrices round otherwise at another scale: corners may move to the next 1/256 pixel.";
  surfaces.curve.x = "scale";
  StabilityFinding colors = surfaces;
  colors.name = "scale/light";
  colors.unit = "share of pixels off by more than 1 level of 255";
  colors.limit = kMoved * std::max(edges(expected.keys), color_edges(expected.radiance));
  colors.why = "As for surfaces; any length that did not scale would change whole surfaces.";
  for (int power = -6; power <= 6; ++power) {
    const double factor = std::pow(10.0, power);
    const Picture found = scaled_picture(globals, scale_placements, factor);
    surfaces.curve.points.emplace_back(factor, other_surfaces(expected.keys, found.keys));
    colors.curve.points.emplace_back(factor, other_colors(expected.radiance, found.radiance));
    surfaces.measured = std::max(surfaces.measured, surfaces.curve.points.back().second);
    colors.measured = std::max(colors.measured, colors.curve.points.back().second);
  }
  return {surfaces, colors};
}

}  // namespace

std::vector<StabilityFinding> scale(const Globals& globals) {
  const Picture expected = make_picture(globals, exhibits(), exhibits_view(), exhibits_light());
  std::vector<StabilityFinding> findings{
      powers_of_two(globals, expected, scale_placements, "scale/powers-of-two-placed", "placements"),
      powers_of_two(globals, expected, scale_vertices, "scale/powers-of-two-vertices", "vertices")};
  for (StabilityFinding& finding : powers_of_ten(globals, expected)) findings.push_back(std::move(finding));
  // Pictures of nothing are all alike.
  if (edges(expected.keys) > 0.01 && color_edges(expected.radiance) > 0.01) return findings;
  for (StabilityFinding& finding : findings) finding.measured = std::numeric_limits<double>::infinity();
  return findings;
}

}  // namespace hpr::stability
