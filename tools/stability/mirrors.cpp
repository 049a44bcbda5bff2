#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

#include "tools/stability/cases.h"
#include "tools/stability/light_tools.h"
#include "tools/stability/tools.h"

// Two mirrors face one another. A ray that goes from one to the other leaves them after as many reflections as its
// slant allows, each of which takes its share, and then meets an even sky.
namespace hpr::stability {
namespace {

constexpr int kDeepest = 64;
constexpr float kReflectance = 0.9F;

/// Mirrors in the planes z = 0 and z = 1, for x up to 1.
Scene facing_mirrors() {
  Scene scene;
  add_placed(scene, parallelogram({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}), mirror(kReflectance), glm::dmat4(1.0));
  add_placed(scene, parallelogram({-1, -1, 1}, {0, 2, 0}, {2, 0, 0}), mirror(kReflectance), glm::dmat4(1.0));
  Environment sky;
  sky.image = Image<Rgb>({1, 1}, {1.0F, 1.0F, 1.0F});
  scene.environment = sky;
  finish_scene(scene);
  return scene;
}

struct Seen {
  double radiance = 0.0;
  double expected = 0.0;  ///< without a cap
};

/// From half way between the mirrors, by so many reflections: reflection k lies at x = (k - 1/2) / reflections.
Seen look(const Scene& scene, int reflections, int max_depth) {
  const double slope = 1.0 / reflections;
  RaySettings settings = only({PassId::Reflection});
  settings.max_depth = max_depth;
  const View view = glance(scene, {0.0, 0.0, 0.5}, {0.5 * slope, 0.0, 1.0});
  const double cosine = 1.0 / std::sqrt(1.0 + slope * slope);
  const double rho = kReflectance;
  const double each = rho + (1.0 - rho) * std::pow(1.0 - cosine, 5.0);  // Schlick's term
  return {glanced(scene, view, settings), std::pow(each, reflections)};
}

}  // namespace

std::vector<StabilityFinding> mirrors(const Globals& /*globals*/) {
  const Scene scene = facing_mirrors();
  StabilityFinding falls = finding("mirrors/decay", "1 .. 64 reflections between facing mirrors of 0.9", 0.0,
                                   "relative", "each reflection rounds in double, the picture once to float");
  falls.limit = kFloatRounding + 32.0 * kDeepest * kDoubleRounding;
  falls.curve.x = "reflections";
  for (int depth = 1; depth <= kDeepest; ++depth) {
    const Seen seen = look(scene, depth, kDeepest);
    const double error = std::abs(seen.radiance / seen.expected - 1.0);
    falls.measured = worse(falls.measured, error);
    falls.curve.points.emplace_back(depth, error);
  }
  // Deeper than any option asks for; paths end where hardly any light is left.
  int depth = kDeepest + 1;
  while (depth < 256 && look(scene, depth, 256).radiance > 0.0) ++depth;
  falls.breaks_at = depth;

  StabilityFinding cap = finding("mirrors/cap", "max depth 1, 2, 16, 63 and one reflection more", 0.0, "radiance",
                                 "past the cap nothing is followed");
  for (const int most : {1, 2, 16, 63}) {
    cap.measured = worse(cap.measured, look(scene, most + 1, most).radiance);
    const Seen last = look(scene, most, most);
    if (!(last.radiance > 0.5 * last.expected)) cap.measured = worse(cap.measured, last.expected);
  }
  return {falls, cap};
}

}  // namespace hpr::stability
