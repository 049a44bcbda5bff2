#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <glm/gtc/matrix_transform.hpp>

#include "tools/stability/stability.h"
#include "tools/stability/tools.h"

namespace hpr::stability {
namespace {

constexpr double kDepthNear = 1e-3;
constexpr double kFar = 1e7;  // of the standard mapping it is compared with
constexpr double kPromisedGap = 1e-6;
constexpr int kPairs = 64;
constexpr int kPairPixels = 16;
using Gaps = std::array<double, kPairs>;

double distance_of(int pair) {
  return kDepthNear * std::pow(kFar / kDepthNear, pair / (kPairs - 1.0));
}

/// Pair j in its own columns of the screen at its own distance, the second surface behind the first by a share gaps[j]
/// of it. The farther ones have the lower ids: equal depths show them.
Scene pairs_of(const Gaps& gaps) {
  Scene scene;
  Mesh unit = rectangle({0.0F, -1.0F}, {1.0F, 1.0F});
  unit.normals = smooth_normals(unit.positions, unit.triangles);
  scene.meshes.push_back(std::move(unit));
  for (const bool front : {false, true}) {
    for (int pair = 0; pair < kPairs; ++pair) {
      const double z = distance_of(pair) * (front ? 1.0 : 1.0 + gaps.at(static_cast<std::size_t>(pair)));
      const double left = -1.0 + (pair + 0.125) / (kPairs / 2.0);
      const glm::dmat4 moved = glm::translate(glm::dmat4(1.0), {left * z, 0.0, -z});
      scene.instances.push_back({0, glm::scale(moved, {0.75 / (kPairs / 2.0) * z, z, 1.0}), 0});
    }
  }
  finish_scene(scene);
  return scene;
}

/// Per pair how many of its pixels do not show the nearer surface, and of how many.
struct Score {
  std::array<int, kPairs> wrong{};
  int pixels = 0;  ///< of all pairs

  [[nodiscard]] double fraction() const {
    int sum = 0;
    for (const int count : wrong) sum += count;
    return static_cast<double>(sum) / pixels;
  }
};

Score score(Drawer& drawer, const Gaps& gaps) {
  const View view = head_on({kPairs * kPairPixels, kPairPixels}, 1.0, kDepthNear);
  const Image<Key> keys = drawer.draw(pairs_of(gaps), view);
  Score result;
  for (int pair = 0; pair < kPairs; ++pair) {
    const auto first_front = static_cast<std::uint32_t>(2 * (kPairs + pair));
    for (int y = 0; y < kPairPixels; ++y) {
      for (int x = pair * kPairPixels + 4; x < pair * kPairPixels + 12; ++x) {
        const std::uint32_t surface = key_surface(keys.at(x, y));
        const bool right = keys.at(x, y) != kNoKey && (surface == first_front || surface == first_front + 1);
        result.wrong.at(static_cast<std::size_t>(pair)) += right ? 0 : 1;
        ++result.pixels;
      }
    }
  }
  return result;
}

Gaps equal_gaps(double gap) {
  Gaps gaps{};
  gaps.fill(gap);
  return gaps;
}

/// Per distance the gap at which order is lost: all are bisected at once, a drawing a step.
Gaps break_gaps(Drawer& drawer) {
  Gaps holds = equal_gaps(1e-2);
  Gaps breaks = equal_gaps(1e-9);
  for (int step = 0; step < 12; ++step) {
    Gaps midpoint{};
    for (std::size_t i = 0; i < midpoint.size(); ++i) midpoint.at(i) = std::sqrt(holds.at(i) * breaks.at(i));
    const Score found = score(drawer, midpoint);
    for (std::size_t i = 0; i < midpoint.size(); ++i) {
      (found.wrong.at(i) == 0 ? holds : breaks).at(i) = midpoint.at(i);
    }
  }
  return breaks;
}

/// The depth a standard [0, 1] mapping stores, as OpenGL computes it from floats: in float, or in 24 bits.
double standard_depth(double z, bool fixed_point) {
  const auto scale = static_cast<float>(kFar / (kFar - kDepthNear));
  const auto offset = static_cast<float>(-kFar * kDepthNear / (kFar - kDepthNear));
  const auto w = static_cast<float>(z);
  const float depth = (scale * w + offset) * (1.0F / w);
  return fixed_point ? std::round(double{depth} * 16777215.0) : double{depth};
}

/// Whether surfaces a fraction `gap` of their distance apart keep their order at 64 distances near `z`: at one of them
/// rounding may help.
bool standard_order_kept(double z, double gap, bool fixed_point) {
  for (int i = 0; i < 64; ++i) {
    const double near_z = z * (1.0 + 1e-3 * i);
    if (!(standard_depth(near_z * (1.0 + gap), fixed_point) > standard_depth(near_z, fixed_point))) return false;
  }
  return true;
}

/// The distance up to which all pairs keep their order; that of the nearest one where even that does not.
double reach_of(const std::function<bool(int pair)>& keeps_order) {
  double reach = distance_of(0);
  for (int pair = 0; pair < kPairs && keeps_order(pair); ++pair) reach = distance_of(pair);
  return reach;
}

/// How much farther the order of what was drawn holds than that of a standard mapping would.
StabilityFinding reach(const Gaps& breaks) {
  // Order holds to the farthest pair; depth n / z in steps of 2^-24 resolves gaps of z 2^-24 / n.
  const double limit = distance_of(kPairs - 1) / (2.0 * kPromisedGap * kDepthNear / kFloatRounding);
  StabilityFinding finding = make_finding(
      "depth-order/reach",
      fmt::format("a relative gap of 1e-6, near {:g} m; standard mapping, far {:g} m, computed", kDepthNear, kFar),
      limit, "times as far as a standard mapping in float or 24 bits",
      "A standard mapping has steps of 2^-24 in n / z, twice as fine nearer than 2 n in float.");
  finding.bound = Bound::AtLeast;
  finding.curve.x = "distance, m";
  for (int pair = 0; pair < kPairs; ++pair) {
    const double z = distance_of(pair);
    finding.curve.points.emplace_back(
        z, breaking_point(1e12, 1e-9, 0.01, [&](double gap) { return standard_order_kept(z, gap, false); }));
    finding.curve.expected.emplace_back(z, z * kFloatRounding / kDepthNear);
  }
  const auto standard = [&](bool fixed_point) {
    return reach_of([&](int pair) { return standard_order_kept(distance_of(pair), kPromisedGap, fixed_point); });
  };
  const double drawn = reach_of([&](int pair) { return breaks.at(static_cast<std::size_t>(pair)) <= kPromisedGap; });
  finding.measured = drawn / std::max(standard(false), standard(true));
  return finding;
}

std::vector<StabilityFinding> measure_depth_order(const Globals& globals) {
  Drawer drawer(globals);
  StabilityFinding order = make_finding(
      "depth-order/reversed-z",
      fmt::format("relative gap 1e-2 .. 1e-6 at 1e-3 .. 1e7 m, {} distances, near {:g} m", kPairs, kDepthNear), 0.0,
      "share of pixels",
      "Depth n / w takes three roundings: two surfaces keep their order from 6 x 2^-24 = 3.6e-7 on.");
  order.curve.x = "relative gap";
  for (const double gap : {1e-8, 3e-8, 6e-8, 1e-7, 1.3e-7, 1.6e-7, 2e-7, 4e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2}) {
    const double fraction = score(drawer, equal_gaps(gap)).fraction();
    add_point(order, gap, fraction, gap >= kPromisedGap);
  }

  StabilityFinding gap = make_finding(
      "depth-order/smallest-gap", "distance 1e-3 .. 1e7 m, the gap at which any pixel is wrong, by bisection",
      6.0 * kFloatRounding, "relative", "Three roundings of 2^-24 in the depth of each of the two surfaces.");
  gap.curve.x = "distance, m";
  const Gaps breaks = break_gaps(drawer);
  for (int pair = 0; pair < kPairs; ++pair) {
    gap.curve.points.emplace_back(distance_of(pair), breaks.at(static_cast<std::size_t>(pair)));
    gap.curve.expected.emplace_back(distance_of(pair), 2.0 * kFloatRounding);
  }
  gap.measured = *std::ranges::max_element(breaks);
  order.breaks_at = gap.measured;
  return {order, gap, reach(breaks)};
}

constexpr Size kCrossingSize{1024, 16};
constexpr double kCrossingNear = 0.01;

/// How far from the line in which they cross a pixel shows the farther of two planes: one faces the eye at `distance`,
/// the other is turned by `angle` about an upright line beside the middle.
double line_error(Drawer& drawer, double distance, double angle) {
  const double line = 0.137 * distance;
  const auto placed = [&](double turned) {
    const glm::dmat4 moved = glm::translate(glm::dmat4(1.0), {line, 0.0, -distance});
    return glm::scale(glm::rotate(moved, turned, glm::dvec3(0.0, 1.0, 0.0)), glm::dvec3(distance));
  };
  Scene scene;
  add(scene, rectangle({-1.4F, -0.5F}, {1.4F, 0.5F}), placed(0.0));
  add(scene, rectangle({-1.4F, -0.5F}, {1.4F, 0.5F}), placed(angle));
  finish_scene(scene);
  const View view = head_on(kCrossingSize, 1.0, kCrossingNear);
  const Image<Key> keys = drawer.draw(scene, view);
  double farthest = 0.0;
  for (int y = 0; y < kCrossingSize.height; ++y) {
    for (int x = 0; x < kCrossingSize.width; ++x) {
      // Where the pixel's ray meets the turned plane: `along` from the line, nearer than the other plane if negative.
      const double slope = -1.0 + 2.0 * (x + 0.5) / kCrossingSize.width;
      const double along = (slope * distance - line) / (std::cos(angle) - slope * std::sin(angle));
      const bool turned_seen = keys.at(x, y) != kNoKey && key_surface(keys.at(x, y)) >= 2;
      const bool turned_nearer = along < 0.0;
      if (keys.at(x, y) == kNoKey || turned_seen != turned_nearer) farthest = std::max(farthest, std::abs(along));
    }
  }
  return farthest;
}

/// Roundings, in units of 2^-24, in the depths of the two planes: docs/numerics.md.
double roundings(double angle) {
  return 13.0 + 60.0 * std::sin(angle);
}

std::vector<StabilityFinding> measure_crossing_planes(const Globals& globals) {
  Drawer drawer(globals);
  StabilityFinding finding =
      make_finding("crossing/line",
                   "angle 1e-1 .. 1e-5 rad at 1, 100 and 10 000 m: distance from the true line x sin(angle) / depth",
                   roundings(0.1) * kFloatRounding, "relative",
                   "The planes lie x sin(angle) apart beside their line; depth takes 13 + 60 sin(angle) roundings.");
  finding.curve.x = "angle, rad";
  for (const double angle : {1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1}) {
    double worst = 0.0;
    for (const double distance : {1.0, 100.0, 1e4}) {
      worst = std::max(worst, line_error(drawer, distance, angle) * std::sin(angle) / distance);
    }
    add_point(finding, angle, worst);
    finding.curve.expected.emplace_back(angle, roundings(angle) * kFloatRounding);
  }
  return {finding};
}

constexpr int kRows = 512;
constexpr Size kSlantedSize{16, kRows};
constexpr double kSlantedNear = 1e-3;
constexpr double kNearEdge = 0.5;  // where the ground begins, metres along the view axis
constexpr double kFarEdge = 1e7;

/// A strip of ground as wide as the view, from before the picture's lower edge to where no row is left.
Mesh ground() {
  Mesh mesh;
  for (const double z : {kNearEdge, kFarEdge}) {
    for (const double side : {-1.0, 1.0}) mesh.positions.emplace_back(glm::dvec3(0.05 * z * side, -1.0, -z));
  }
  mesh.triangles = {{0, 1, 3}, {0, 3, 2}};
  return mesh;
}

/// Per row below the horizon whether it shows the nearer of two grounds, the farther being the nearer one enlarged
/// about the eye: along each ray it lies farther by a share `gap` of the distance.
std::vector<bool> right_rows(Drawer& drawer, double gap) {
  Scene scene;
  add(scene, ground(), glm::scale(glm::dmat4(1.0), glm::dvec3(1.0 + gap)));
  add(scene, ground());
  finish_scene(scene);
  View view = head_on(kSlantedSize, 1.0 / 32.0, kSlantedNear);
  view.top = 1.0;
  view.bottom = -1.0;
  const Image<Key> keys = drawer.draw(scene, view);
  std::vector<bool> right;
  for (int y = kRows / 2; y < kRows; ++y) {
    right.push_back(std::ranges::all_of(keys.row(y), [](Key key) { return key != kNoKey && key_surface(key) >= 2; }));
  }
  return right;
}

std::vector<StabilityFinding> measure_slanted_planes(const Globals& globals) {
  Drawer drawer(globals);
  constexpr int kGaps = 60;
  std::vector<double> lost(kRows / 2, 0.0);  // per row the largest gap that is lost
  for (int i = 0; i < kGaps; ++i) {
    const double gap = 1e-8 * std::pow(10.0, 6.0 * i / (kGaps - 1.0));
    const std::vector<bool> right = right_rows(drawer, gap);
    for (std::size_t row = 0; row < lost.size(); ++row) {
      if (!right[row]) lost[row] = gap;
    }
  }
  // Of each triangle's depth, at most: 42 roundings of its plane and 10 of its corners and of the sum;
  // docs/numerics.md.
  constexpr double kRoundings = 2.0 * 52.0;
  StabilityFinding finding = make_finding(
      "slanted/ground", "ground from 0.5 to 1e7 m, seen from 1 m up: the gap that is lost x nearest depth / distance",
      kRoundings * kFloatRounding, "relative to the nearest corner's depth",
      "Depth is interpolated in floats from corner to corner, so it rounds as the largest depth does.");
  finding.curve.x = "distance, m";
  for (std::size_t row = lost.size(); row-- > 0;) {
    const double z = 0.5 * kRows / (static_cast<double>(row) + 0.5);
    add_point(finding, z, lost[row] * kNearEdge / z);
  }
  return {finding};
}

}  // namespace

StabilityCase depth_order_case() {
  return {"depth-order", "pairs of close surfaces from 1 mm to 10 000 km: the nearer one is seen", measure_depth_order};
}

StabilityCase crossing_planes_case() {
  return {"crossing", "two planes that cross at a small angle: the line lies where it should", measure_crossing_planes};
}

StabilityCase slanted_planes_case() {
  return {"slanted", "ground to the horizon: what its depth resolves", measure_slanted_planes};
}

}  // namespace hpr::stability
