#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

#include "tools/stability/cases.h"
#include "tools/stability/tools.h"

namespace hpr::stability {
namespace {

constexpr int kRows = 512;
constexpr Size kSize{16, kRows};
constexpr double kNear = 1e-3;
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
  View view = head_on(kSize, 1.0 / 32.0, kNear);
  view.top = 1.0;
  view.bottom = -1.0;
  const Image<Key> keys = drawer.draw(scene, view);
  std::vector<bool> right;
  for (int y = kRows / 2; y < kRows; ++y) {
    right.push_back(std::ranges::all_of(keys.row(y), [](Key key) { return key != kNoKey && key_surface(key) >= 2; }));
  }
  return right;
}

}  // namespace

std::vector<StabilityFinding> slanted_planes(const Globals& globals) {
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
  StabilityFinding finding;
  finding.name = "slanted/ground";
  finding.parameter = "ground from 0.5 to 1e7 m, seen from 1 m up: the gap that is lost x nearest depth / distance";
  finding.unit = "relative to the nearest corner's depth";
  finding.limit = kRoundings * kFloatRounding;
  finding.why = "Depth is interpolated in floats from corner to corner, so it rounds as the largest depth does.";
  finding.curve.x = "distance, m";
  for (std::size_t row = lost.size(); row-- > 0;) {
    const double z = 0.5 * kRows / (static_cast<double>(row) + 0.5);
    finding.measured = std::max(finding.measured, lost[row] * kNearEdge / z);
    finding.curve.points.emplace_back(z, lost[row] * kNearEdge / z);
  }
  return {finding};
}

}  // namespace hpr::stability
