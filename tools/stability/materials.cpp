#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "rt/materials/bsdf.h"
#include "rt/sampling/sampler.h"
#include "scene/generators/shapes.h"
#include "tools/stability/stability.h"
#include "tools/stability/tools.h"

namespace hpr::stability {
namespace {

// Roughness 0 and 1, an index of refraction of 1, and the way there.

constexpr std::uint32_t kSamples = 1U << 12U;
constexpr Size kPicture{96, 96};

Bsdf bsdf_at(const MaterialPoint& material, double polar, Carried carried) {
  SurfacePoint point;
  point.to_viewer = {std::sin(polar), 0.0, std::cos(polar)};
  point.geometric_normal = point.shading_normal = {0.0, 0.0, 1.0};
  return {material, point, carried};
}

/// What of a furnace's light samples of all lobes, each chosen by nobody, give back together in the mean.
double furnace(const MaterialPoint& material, double polar) {
  const Bsdf bsdf = bsdf_at(material, polar, Carried::Flux);
  double sum = 0.0;
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    for (const Lobe lobe : kLobes) {
      Sampler random(7, i);
      if (const auto sample = bsdf.sample(lobe, random.two())) sum += sample->weight.g / kSamples;
    }
  }
  return sum;
}

StabilityFinding energy() {
  StabilityFinding most =
      make_finding("materials/furnace", "white metal of roughness 0 .. 1, looked at from 0 to 89.4 degrees",
                   1.0 + (3.0 * kSamples + 64.0) * kDoubleRounding, "of what arrives",
                   "a sample's weight is Fresnel's share times a masking of 1 at the most");
  most.curve.x = "roughness";
  for (const double roughness : {0.0, 1e-4, 9e-4, 1.1e-3, 0.01, 0.1, 0.3, 0.6, 1.0}) {
    double worst = 0.0;
    for (const double polar : {0.0, 0.5, 1.0, 1.4, 1.56}) {
      MaterialPoint metal;
      metal.metallic = 1.0;
      metal.roughness = roughness;
      worst = std::max(worst, furnace(metal, polar));
    }
    add_point(most, roughness, worst);
  }
  return most;
}

StabilityFinding kept_energy() {
  constexpr double kRoughest = 0.01;
  constexpr double kSteepest = 1.56;
  const double masked = std::tan(kSteepest) * kRoughest * kRoughest;  // alpha tan
  StabilityFinding least = make_finding(
      "materials/furnace-smooth", "white metal of roughness 0 .. 0.01, looked at from 0 to 89.4 degrees",
      1.0 - masked * masked - 1.0 / kSamples, "of what arrives",
      "Smith's masking takes (alpha tan)^2 / 4 on either way, the horizon as much; and one sample in 4096");
  least.bound = Bound::AtLeast;
  least.measured = 1.0;
  least.curve.x = "roughness";
  for (const double roughness : {0.0, 1e-4, 9e-4, 1.1e-3, kRoughest}) {
    double worst = 1.0;
    for (const double polar : {0.0, 0.5, 1.0, 1.4, kSteepest}) {
      MaterialPoint metal;
      metal.metallic = 1.0;
      metal.roughness = roughness;
      const double shown = furnace(metal, polar);
      worst = std::isfinite(shown) ? std::min(worst, shown) : 0.0;
    }
    least.measured = std::min(least.measured, worst);
    least.curve.points.emplace_back(roughness, worst);
  }
  return least;
}

/// What a white metal shows of surroundings of radiance (1 + x) / 2 along direction (x, y, z).
double shown(double roughness, double polar) {
  MaterialPoint metal;
  metal.metallic = 1.0;
  metal.roughness = roughness;
  const Bsdf bsdf = bsdf_at(metal, polar, Carried::Radiance);
  double sum = 0.0;
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    Sampler random(11, i);
    if (const auto sample = bsdf.sample(Lobe::Reflection, random.two())) {
      sum += sample->weight.g * 0.5 * (1.0 + sample->direction.x) / kSamples;
    }
  }
  return sum;
}

StabilityFinding smooth() {
  constexpr double kSteepest = 1.4;
  // Half vectors lie off the normal by (pi / 2) alpha in the mean, and by their projection's share more for who looks
  // from the side; directions turn twice as far, and the surroundings change by half of that.
  const auto limit = [](double roughness, double polar) {
    const double alpha = roughness * roughness;
    return 0.5 * std::numbers::pi * alpha * (1.0 + std::tan(polar)) + 1024.0 * kDoubleRounding;
  };
  constexpr double kMinRoughness = 1.0001 * Bsdf::kDeltaRoughness;
  StabilityFinding jump = make_finding(
      "materials/mirror-limit", "white metal just above the roughness of a mirror, from 0 to 80 degrees",
      limit(kMinRoughness, kSteepest), "radiance", "GGX of alpha turns directions by pi alpha in the mean");
  jump.curve.x = "roughness";
  for (const double roughness : {kMinRoughness, 2e-3, 5e-3, 0.01, 0.03, 0.1}) {
    double worst = 0.0;
    for (const double polar : {0.0, 0.5, 1.0, kSteepest}) {
      worst = worse(worst, std::abs(shown(roughness, polar) - shown(0.0, polar)));
    }
    if (roughness == kMinRoughness) jump.measured = worst;
    jump.curve.points.emplace_back(roughness, worst);
    jump.curve.expected.emplace_back(roughness, limit(roughness, kSteepest));
  }
  return jump;
}

/// A lit wall five metres behind the eye's focus, with or without a ball of clear glass before it.
Scene wall_behind(double ior) {
  Scene scene;
  add_placed(scene, parallelogram({-6, -6, -3}, {12, 0, 0}, {0, 12, 0}), diffuse(), glm::dmat4(1.0));
  if (ior > 0.0) {
    Material glass = diffuse();
    glass.roughness = 0.0F;
    glass.transmission = 1.0F;
    glass.thickness = 1.0F;
    glass.ior = static_cast<float>(ior);
    add_placed(scene, shapes::icosphere(5), glass, glm::dmat4(1.0));
  }
  Light light;
  light.position = {2.0, 3.0, 3.0};
  light.intensity = glm::vec3(30.0F);
  scene.lights = {light};
  finish_scene(scene);
  return scene;
}

/// The largest relative difference glass of this index makes, where rays meet the ball's middle: at less than 45
/// degrees.
double difference(double ior, int threads) {
  const Scene without = wall_behind(0.0);
  const Scene with = wall_behind(ior);
  View view = make_view(look_at({0.0, 0.0, 4.0}, {0.0, 0.0, 0.0}, {0, 1, 0}, 0.33), kPicture, without.bounds);
  view.near_distance = 0.1;
  const LitPicture bare = lit_picture(without, view, only({}, threads));
  const LitPicture reflected = lit_picture(with, view, only({PassId::Reflection, PassId::Refraction}, threads));
  double worst = 0.0;
  for (int y = 0; y < kPicture.height; ++y) {
    for (int x = 0; x < kPicture.width; ++x) {
      const double expected = bare.image.at(x, y).r;
      worst = worse(worst, std::abs(static_cast<double>(reflected.image.at(x, y).r) - expected) / expected);
    }
  }
  return reflected.counts[PassId::Refraction] > 0 ? worst : std::numeric_limits<double>::infinity();
}

std::vector<StabilityFinding> indices(int threads) {
  // A ray turns by 2 (n - 1) tan i in all, i <= 50 degrees at facets, goes on for 4 m, meets the wall at a cosine of
  // 0.96 or more, where radiance changes by no more than 3 / 6 of itself a metre; surfaces reflect ((n - 1) / (n +
  // 1))^2 each and add no more than that, twice over. Origins move by two offsets of 4 steps of 8 metres, twice.
  const auto limit = [](double ior) {
    const double over = ior - 1.0;
    const double shift = 2.0 * over * std::tan(50.0 * std::numbers::pi / 180.0) * 4.0 / 0.96 + 4.0 * 32.0 * 0x1p-23;
    return 0.5 * shift + over * over + 4.0 * kFloatRounding;
  };
  StabilityFinding none =
      make_finding("materials/no-interface", "a ball of glass of index 1 against no ball at all", limit(1.0),
                   "relative", "nothing is refracted; rays start again, off the surface");
  none.measured = difference(1.0, threads);
  StabilityFinding weak = make_finding("materials/weak-interface", "a ball of glass of index 1.0001", limit(1.0001),
                                       "relative", "rays turn by twice the index's excess over 1, times the tangent");
  weak.measured = difference(1.0001, threads);
  weak.curve.x = "index less 1";
  for (const double over : {1e-6, 1e-5, 1e-4, 1e-3, 1e-2}) {
    weak.curve.points.emplace_back(over, difference(1.0 + over, threads));
    weak.curve.expected.emplace_back(over, limit(1.0 + over));
  }
  return {none, weak};
}

std::vector<StabilityFinding> measure_materials(const Globals& globals) {
  std::vector<StabilityFinding> all{energy(), kept_energy(), smooth()};
  for (StabilityFinding& one : indices(threads_of(globals))) all.push_back(std::move(one));
  return all;
}

// Two mirrors face one another. A ray that goes from one to the other leaves them after as many reflections as its
// slant allows, each of which takes its share, and then meets an even sky.

constexpr int kMaxDepth = 64;
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

struct Reflected {
  double radiance = 0.0;
  double expected = 0.0;  ///< without a cap
};

/// From half way between the mirrors, by so many reflections: reflection k lies at x = (k - 1/2) / reflections.
Reflected reflect_times(const Scene& scene, int reflections, int max_depth) {
  const double slope = 1.0 / reflections;
  RaySettings settings = only({PassId::Reflection});
  settings.max_depth = max_depth;
  const View view = glance(scene, {0.0, 0.0, 0.5}, {0.5 * slope, 0.0, 1.0});
  const double cosine = 1.0 / std::sqrt(1.0 + slope * slope);
  const double rho = kReflectance;
  const double each = rho + (1.0 - rho) * std::pow(1.0 - cosine, 5.0);  // Schlick's term
  return {glanced(scene, view, settings), std::pow(each, reflections)};
}

std::vector<StabilityFinding> measure_mirrors(const Globals& /*globals*/) {
  const Scene scene = facing_mirrors();
  StabilityFinding falls = make_finding("mirrors/decay", "1 .. 64 reflections between facing mirrors of 0.9", 0.0,
                                        "relative", "each reflection rounds in double, the picture once to float");
  falls.limit = kFloatRounding + 32.0 * kMaxDepth * kDoubleRounding;
  falls.curve.x = "reflections";
  for (int depth = 1; depth <= kMaxDepth; ++depth) {
    const Reflected reflected = reflect_times(scene, depth, kMaxDepth);
    const double error = std::abs(reflected.radiance / reflected.expected - 1.0);
    add_point(falls, depth, error);
  }
  // Deeper than any option asks for; paths end where hardly any light is left.
  int depth = kMaxDepth + 1;
  while (depth < 256 && reflect_times(scene, depth, 256).radiance > 0.0) ++depth;
  falls.breaks_at = depth;

  StabilityFinding cap = make_finding("mirrors/cap", "max depth 1, 2, 16, 63 and one reflection more", 0.0, "radiance",
                                      "past the cap nothing is followed");
  for (const int most : {1, 2, 16, 63}) {
    cap.measured = worse(cap.measured, reflect_times(scene, most + 1, most).radiance);
    const Reflected last = reflect_times(scene, most, most);
    if (!(last.radiance > 0.5 * last.expected)) cap.measured = worse(cap.measured, last.expected);
  }
  return {falls, cap};
}

}  // namespace

StabilityCase materials_case() {
  return {"materials", "roughness and index at their ends: no energy is made, nothing jumps", measure_materials};
}

StabilityCase mirrors_case() {
  return {"mirrors", "facing mirrors: radiance falls by the same share at every reflection", measure_mirrors};
}

}  // namespace hpr::stability
