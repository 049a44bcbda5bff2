#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <glm/gtc/matrix_transform.hpp>

#include "tools/stability/cases.h"
#include "tools/stability/tools.h"

namespace hpr::stability {
namespace {

constexpr double kNear = 1e-3;
constexpr double kFar = 1e7;  // of the standard mapping it is compared with
constexpr double kPromisedGap = 1e-6;
constexpr int kPairs = 64;
constexpr int kPairPixels = 16;
using Gaps = std::array<double, kPairs>;

double distance_of(int pair) {
  return kNear * std::pow(kFar / kNear, pair / (kPairs - 1.0));
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

  [[nodiscard]] double share() const {
    int sum = 0;
    for (const int count : wrong) sum += count;
    return static_cast<double>(sum) / pixels;
  }
};

Score score(Drawer& drawer, const Gaps& gaps) {
  const View view = head_on({kPairs * kPairPixels, kPairPixels}, 1.0, kNear);
  const Image<Key> keys = drawer.draw(pairs_of(gaps), view);
  Score result;
  for (int pair = 0; pair < kPairs; ++pair) {
    const auto first_front = static_cast<std::uint32_t>(2 * (kPairs + pair));
    for (int y = 0; y < kPairPixels; ++y) {
      for (int x = pair * kPairPixels + 4; x < pair * kPairPixels + 12; ++x) {
        const std::uint32_t seen = key_surface(keys.at(x, y));
        const bool right = keys.at(x, y) != kNoKey && (seen == first_front || seen == first_front + 1);
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
    Gaps middle{};
    for (std::size_t i = 0; i < middle.size(); ++i) middle.at(i) = std::sqrt(holds.at(i) * breaks.at(i));
    const Score found = score(drawer, middle);
    for (std::size_t i = 0; i < middle.size(); ++i) {
      (found.wrong.at(i) == 0 ? holds : breaks).at(i) = middle.at(i);
    }
  }
  return breaks;
}

/// The depth a standard [0, 1] mapping stores, as OpenGL computes it from floats: in float, or in 24 bits.
double standard_depth(double z, bool fixed_point) {
  const auto scale = static_cast<float>(kFar / (kFar - kNear));
  const auto offset = static_cast<float>(-kFar * kNear / (kFar - kNear));
  const auto w = static_cast<float>(z);
  const float depth = (scale * w + offset) * (1.0F / w);
  return fixed_point ? std::round(double{depth} * 16777215.0) : double{depth};
}

/// Whether surfaces a share `gap` apart are told apart, at 64 distances near `z`: at one of them rounding may help.
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
  StabilityFinding finding;
  finding.name = "depth-order/reach";
  finding.parameter =
      fmt::format("a relative gap of 1e-6, near {:g} m; standard mapping, far {:g} m, computed", kNear, kFar);
  finding.unit = "times as far as a standard mapping in float or 24 bits";
  finding.bound = Bound::AtLeast;
  // Order holds to the farthest pair; depth n / z in steps of 2^-24 resolves gaps of z 2^-24 / n.
  finding.limit = distance_of(kPairs - 1) / (2.0 * kPromisedGap * kNear / kFloatRounding);
  finding.why = "A standard mapping has steps of 2^-24 in n / z, twice as fine nearer than 2 n in float.";
  finding.curve.x = "distance, m";
  for (int pair = 0; pair < kPairs; ++pair) {
    const double z = distance_of(pair);
    finding.curve.points.emplace_back(
        z, breaking_point(1e12, 1e-9, 0.01, [&](double gap) { return standard_order_kept(z, gap, false); }));
    finding.curve.expected.emplace_back(z, z * kFloatRounding / kNear);
  }
  const auto standard = [&](bool fixed_point) {
    return reach_of([&](int pair) { return standard_order_kept(distance_of(pair), kPromisedGap, fixed_point); });
  };
  const double drawn = reach_of([&](int pair) { return breaks.at(static_cast<std::size_t>(pair)) <= kPromisedGap; });
  finding.measured = drawn / std::max(standard(false), standard(true));
  return finding;
}

}  // namespace

std::vector<StabilityFinding> depth_order(const Globals& globals) {
  Drawer drawer(globals);
  StabilityFinding order;
  order.name = "depth-order/reversed-z";
  order.parameter = fmt::format("relative gap 1e-2 .. 1e-6 at 1e-3 .. 1e7 m, {} distances, near {:g} m", kPairs, kNear);
  order.unit = "share of pixels";
  order.why = "Depth n / w takes three roundings: two surfaces keep their order from 6 x 2^-24 = 3.6e-7 on.";
  order.curve.x = "relative gap";
  for (const double gap : {1e-8, 3e-8, 6e-8, 1e-7, 1.3e-7, 1.6e-7, 2e-7, 4e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2}) {
    const double share = score(drawer, equal_gaps(gap)).share();
    order.curve.points.emplace_back(gap, share);
    if (gap >= kPromisedGap) order.measured = std::max(order.measured, share);
  }

  StabilityFinding gap;
  gap.name = "depth-order/smallest-gap";
  gap.parameter = "distance 1e-3 .. 1e7 m, the gap at which any pixel is wrong, by bisection";
  gap.limit = 6.0 * kFloatRounding;
  gap.unit = "relative";
  gap.why = "Three roundings of 2^-24 in the depth of each of the two surfaces.";
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

}  // namespace hpr::stability
