#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <functional>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "core/file.h"
#include "core/json.h"
#include "scene/load_scene.h"
#include "tools/stability/stability.h"
#include "tools/stability/tools.h"

namespace hpr::stability {
namespace {

constexpr double kPromised = 1e7;
constexpr double kPixelsPerMetre = 90.0;  // of the nearest exhibit: 192 / (2 tan 0.4) pixels a metre, 2.5 m away
constexpr double kSnap = 1.0 / 256.0;     // pixels: where OpenGL puts corners
constexpr double kMaxOffset = 1e17;

glm::dvec3 offset_by(double metres) {
  return {std::floor(metres), 0.0, -std::floor(metres)};
}

View moved(View view, double metres) {
  view.eye += offset_by(metres);
  return view;
}

/// The share of pixels an edge that moves by up to `pixels` can change, where a share `edges` of pixels has edges.
double fraction_moved(double edges, double pixels) {
  return std::min(1.0, edges * 2.0 * (pixels + kSnap));
}

/// The pixels whose keys are not the same to the bit.
std::size_t differing_keys(const Image<Key>& a, const Image<Key>& b) {
  std::size_t found = 0;
  for (std::size_t i = 0; i < a.pixels().size(); ++i) found += a.pixels()[i] == b.pixels()[i] ? 0U : 1U;
  return found;
}

/// Where all places are multiples of 2^-10 m, and the offset of whole metres, sums in double are exact.
StabilityFinding exact_positions(Drawer& drawer) {
  constexpr double kSteps = 1024.0;
  const Scene scene = exhibits(kSteps);
  const Image<Key> expected = drawer.draw(scene, exhibits_view(kSteps));
  const auto differing = [&](double metres) {
    Scene other = scene;
    move_placements(other, offset_by(metres));
    return static_cast<double>(differing_keys(expected, drawer.draw(other, moved(exhibits_view(kSteps), metres))));
  };
  StabilityFinding finding = make_finding(
      "offset/exact-places", "places at multiples of 2^-10 m, scene and eye moved by (D, 0, -D), D up to 1e7 m", 0.0,
      "pixels whose keys differ",
      "Sums of such places are exact in double below 2^43 m, and GL sees their differences only.");
  finding.curve.x = "D, m";
  for (int power = 0; power <= 16; ++power) {
    const double metres = std::pow(10.0, power);
    const double fraction = differing(metres);
    add_point(finding, metres, fraction, metres <= kPromised);
  }
  if (finding.holds()) {
    finding.breaks_at =
        breaking_point_if_any(kPromised, kMaxOffset, 0.05, [&](double d) { return differing(d) <= 0.0; });
  }
  return finding;
}

StabilityFinding any_positions(Drawer& drawer) {
  const Scene scene = exhibits();
  const Image<Key> expected = drawer.draw(scene, exhibits_view());
  const double edge_fraction = edges(expected);
  const auto fraction = [&](double metres) {
    Scene other = scene;
    move_placements(other, offset_by(metres));
    return other_surfaces(expected, drawer.draw(other, moved(exhibits_view(), metres)));
  };
  // Scene and eye round to 2^-53 of the offset each.
  const auto bound = [&](double metres) {
    return fraction_moved(edge_fraction, 2.0 * kDoubleRounding * metres * kPixelsPerMetre);
  };
  StabilityFinding finding = make_finding(
      "offset/any-places", "any places, scene and eye moved by (D, 0, -D), D up to 1e7 m", bound(kPromised),
      "share of pixels with another surface",
      "Places round to 2^-53 D; only where that moves a corner to the next 1/256 pixel can an edge change.");
  finding.curve.x = "D, m";
  for (int power = 0; power <= 16; ++power) {
    const double metres = std::pow(10.0, power);
    add_point(finding, metres, fraction(metres), metres <= kPromised);
    finding.curve.expected.emplace_back(metres, bound(metres));
  }
  if (finding.holds()) {
    finding.breaks_at =
        breaking_point_if_any(kPromised, kMaxOffset, 0.05, [&](double d) { return fraction(d) <= finding.limit; });
  }
  return finding;
}

StabilityFinding lit(const Globals& globals) {
  const Scene scene = exhibits();
  const Picture expected = make_picture(globals, scene, exhibits_view(), exhibits_light());
  StabilityFinding finding =
      make_finding("offset/light", "the same with all light, D up to 1e7 m",
                   fraction_moved(std::max(edges(expected.keys), color_edges(expected.radiance)), 0.0),
                   "share of pixels off by more than 1 level of 255",
                   "Rays start from places relative to the scene's middle: as for surfaces, only edges can change.");
  const auto fraction = [&](double metres) {
    Scene other = scene;
    move_placements(other, offset_by(metres));
    const Picture found = make_picture(globals, other, moved(exhibits_view(), metres), exhibits_light());
    return other_colors(expected.radiance, found.radiance);
  };
  finding.curve.x = "D, m";
  for (const double metres : {1e2, 1e4, 1e5, 1e6, 1e7, 1e9}) {
    add_point(finding, metres, fraction(metres), metres <= kPromised);
  }
  if (finding.holds()) {
    finding.breaks_at =
        breaking_point_if_any(kPromised, kMaxOffset, 0.05, [&](double d) { return fraction(d) <= finding.limit; });
  }
  return finding;
}

StabilityFinding baked(Drawer& drawer) {
  constexpr double kPromisedBaked = 1e3;
  const Image<Key> expected = drawer.draw(exhibits(), exhibits_view());
  const double edge_fraction = edges(expected);
  const auto fraction = [&](double metres) {
    Scene other = exhibits();
    move_vertices(other, offset_by(metres));
    return other_surfaces(expected, drawer.draw(other, moved(exhibits_view(), metres)));
  };
  const auto bound = [&](double metres) {
    // Two rounded coordinates, and as much again where the matrix multiplies them and takes the offset off.
    return fraction_moved(edge_fraction, 2.0 * std::sqrt(2.0) * 2.0 * kFloatRounding * metres * kPixelsPerMetre);
  };
  StabilityFinding finding =
      make_finding("offset/baked-vertices", "offset in the vertices, which are floats: D up to 1e3 m",
                   bound(kPromisedBaked), "share of pixels with another surface",
                   "Vertices round to 2^-24 D, before HPR sees them, and again when the eye is taken off.");
  finding.curve.x = "D, m";
  for (double metres = 1.0; metres < 2e8; metres *= std::sqrt(10.0)) {
    add_point(finding, metres, fraction(metres), metres <= kPromisedBaked * 1.001);
    finding.curve.expected.emplace_back(metres, bound(metres));
  }
  if (finding.holds()) {
    finding.breaks_at =
        breaking_point_if_any(kPromisedBaked, 1e9, 0.05, [&](double d) { return fraction(d) <= finding.limit; });
  }
  return finding;
}

std::vector<StabilityFinding> measure_offset(const Globals& globals) {
  Drawer drawer(globals);
  return {exact_positions(drawer), any_positions(drawer), lit(globals), baked(drawer)};
}

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

/// The nearer one of the scales past `promised` and below its reciprocal at which the promise ends.
std::optional<double> breaking_scale(double promised, double relative, const std::function<bool(double)>& holds) {
  constexpr double kMaxScale = 0x1p100;
  const std::optional<double> large = breaking_point_if_any(promised, kMaxScale, relative, holds);
  const std::optional<double> small = breaking_point_if_any(1.0 / promised, 1.0 / kMaxScale, relative, holds);
  if (!large || !small) return large ? large : small;
  return *large * *small > 1.0 ? small : large;
}

StabilityFinding powers_of_two(const Globals& globals, const Picture& expected, ScaleScene scale, const char* name,
                               const char* what) {
  StabilityFinding finding = make_finding(
      name, std::string(what) + " scaled by 2^-20 .. 2^20", 0.0, "pixels of which a bit of key or colour differs",
      "Scaling by a power of two rounds nothing, so only an absolute length somewhere could show.");
  finding.curve.x = "scale";
  const auto differing = [&](double factor) {
    return static_cast<double>(differing_bits(expected, scaled_picture(globals, scale, factor)));
  };
  for (const int power : {-20, -14, -7, -1, 1, 7, 14, 20}) {
    const double factor = std::ldexp(1.0, power);
    add_point(finding, factor, differing(factor));
  }
  if (finding.holds()) {
    const auto nearest_power = [](double factor) { return std::exp2(std::round(std::log2(factor))); };
    const std::optional<double> breaks =
        breaking_scale(0x1p20, 1.0, [&](double factor) { return differing(nearest_power(factor)) <= finding.limit; });
    if (breaks) finding.breaks_at = nearest_power(*breaks);
  }
  return finding;
}

std::vector<StabilityFinding> powers_of_ten(const Globals& globals, const Picture& expected) {
  // An edge moves to the next 1/256 pixel at the most.
  constexpr double kMoved = 2.0 / 256.0;
  StabilityFinding surfaces =
      make_finding("scale/surfaces", "scene, eye and lights scaled by 1e-6 .. 1e6", kMoved * edges(expected.keys),
                   "share of pixels with another surface",
                   "Matrices round otherwise at another scale: corners may move to the next 1/256 pixel.");
  surfaces.curve.x = "scale";
  StabilityFinding colors = surfaces;
  colors.name = "scale/light";
  colors.unit = "share of pixels off by more than 1 level of 255";
  colors.limit = kMoved * std::max(edges(expected.keys), color_edges(expected.radiance));
  colors.why = "As for surfaces; any length that did not scale would change whole surfaces.";
  for (int power = -6; power <= 6; ++power) {
    const double factor = std::pow(10.0, power);
    const Picture found = scaled_picture(globals, scale_placements, factor);
    add_point(surfaces, factor, other_surfaces(expected.keys, found.keys));
    add_point(colors, factor, other_colors(expected.radiance, found.radiance));
  }
  const auto scaled = [&](double factor) { return scaled_picture(globals, scale_placements, factor); };
  if (surfaces.holds()) {
    surfaces.breaks_at = breaking_scale(
        1e6, 0.2, [&](double factor) { return other_surfaces(expected.keys, scaled(factor).keys) <= surfaces.limit; });
  }
  if (colors.holds()) {
    colors.breaks_at = breaking_scale(1e6, 0.2, [&](double factor) {
      return other_colors(expected.radiance, scaled(factor).radiance) <= colors.limit;
    });
  }
  return {surfaces, colors};
}

std::vector<StabilityFinding> measure_scale(const Globals& globals) {
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

/// The placement of one triangle below a chain of nodes, as the loader composes it.
glm::dmat4 placed_below(Json nodes) {
  for (std::size_t i = 0; i + 1 < nodes.size(); ++i) nodes[i]["children"] = Json::array({i + 1});
  nodes.elements().back()["mesh"] = 0;
  // The corners are (0, 0, 0), (1, 0, 0) and (0, 1, 0).
  Json document = Json::parse(R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
      "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
      "buffers": [{"uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA",
                   "byteLength": 36}],
      "bufferViews": [{"buffer": 0, "byteLength": 36}],
      "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                     "min": [0, 0, 0], "max": [1, 1, 0]}]})");
  document["nodes"] = std::move(nodes);
  const TemporaryFile file;
  std::ofstream(file.path()) << document.dump();
  return load_scene(file.path().string()).instances.at(0).to_world;
}

double farthest_from_identity(const glm::dmat4& matrix) {
  double farthest = 0.0;
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) {
      farthest = std::max(farthest, std::abs(matrix[column][row] - (column == row ? 1.0 : 0.0)));
    }
  }
  return farthest;
}

StabilityFinding scales_that_cancel() {
  StabilityFinding finding = make_finding(
      "nodes/scale-and-back", "a node scaled by 10^-k below one scaled by 10^k, k = 1 .. 6", 3.0 * kDoubleRounding,
      "largest error of the composed matrix", "The two factors round to double, and so does their product.");
  finding.curve.x = "outer scale";
  for (int power = 1; power <= 6; ++power) {
    const double factor = std::pow(10.0, power);
    const auto scaled = [](double by) { return Json{{"scale", Json::array({by, by, by})}}; };
    const Json nodes = Json::array({scaled(factor), scaled(1.0 / factor)});
    const Json turned = Json::array({scaled(1.0 / factor), scaled(factor)});
    const double error =
        std::max(farthest_from_identity(placed_below(nodes)), farthest_from_identity(placed_below(turned)));
    add_point(finding, factor, error);
  }
  return finding;
}

StabilityFinding rotations_that_cancel() {
  // Per node: 10 roundings of a quaternion's matrix and 6 of the product, each of entries up to 1.
  const auto bound = [](int count) { return 16.0 * count * kDoubleRounding; };
  StabilityFinding finding =
      make_finding("nodes/rotations", "10 .. 1000 nested rotations that multiply to none", bound(1000),
                   "largest error of the composed matrix", "16 roundings of 2^-53 a node.");
  finding.curve.x = "nodes";
  std::mt19937_64 random(1);
  for (const int count : {10, 30, 100, 300, 1000}) {
    std::vector<Json> there;
    std::vector<Json> back;
    for (int i = 0; i < count / 2; ++i) {
      glm::dvec4 q;
      for (int k = 0; k < 4; ++k) q[k] = static_cast<double>(random() >> 11U) * 0x1p-52 - 1.0;
      q = glm::normalize(q);
      there.push_back(Json{{"rotation", Json::array({q.x, q.y, q.z, q.w})}});
      back.push_back(Json{{"rotation", Json::array({-q.x, -q.y, -q.z, q.w})}});
    }
    there.insert(there.end(), back.rbegin(), back.rend());
    const double drift = farthest_from_identity(placed_below(Json(there)));
    add_point(finding, count, drift);
    finding.curve.expected.emplace_back(count, bound(count));
  }
  return finding;
}

std::vector<StabilityFinding> measure_nodes(const Globals& /*globals*/) {
  return {scales_that_cancel(), rotations_that_cancel()};
}

}  // namespace

StabilityCase offset_case() {
  return {"offset", "scene and eye far from the origin: the picture stays", measure_offset};
}

StabilityCase scale_case() {
  return {"scale", "scenes of micrometres and of thousands of kilometres: the picture stays", measure_scale};
}

StabilityCase nodes_case() {
  return {"nodes", "chains of nodes that cancel out: the placement stays", measure_nodes};
}

}  // namespace hpr::stability
