#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <numbers>
#include <vector>

#include "rt/deferred_shader.h"
#include "rt/trace/ray_scene.h"
#include "rt/trace/surfaces.h"
#include "scene/generators/shapes.h"
#include "tools/stability/stability.h"
#include "tools/stability/tools.h"

// Surfaces that shadow themselves, and light that gets through a cover: both sides of how far a shadow ray's origin is
// moved off its surface.
namespace hpr::stability {
namespace {

constexpr Size kPicture{192, 192};
constexpr double kGrazing = 89.9 * std::numbers::pi / 180.0;

/// Where things stand: a ball of `size` metres and what belongs to it, about `center`.
struct Placement {
  double size = 1.0;
  glm::dvec3 center{0.0};
};

Light sun(double angle_from_z) {
  Light light;
  light.type = LightType::Directional;
  light.direction = glm::vec3(-std::sin(angle_from_z), 0.0, -std::cos(angle_from_z));
  return light;
}

/// A wall in the plane z = 0 and a smooth sphere before it under light that grazes the wall. Nothing stands in any
/// light's way: the sphere's shadow falls on the wall's plane at 286 of its radii, past the wall's end.
Scene grazed(const Placement& at) {
  Scene scene;
  const glm::dmat4 to_world = shapes::placed(at.center, at.size);
  add_placed(scene, parallelogram({-2, -1.5, 0}, {4, 0, 0}, {0, 3, 0}), diffuse(), to_world);
  Mesh ball = shapes::icosphere(4);
  for (glm::vec3& p : ball.positions) p += glm::vec3(0.0F, 0.0F, 1.5F);
  add_placed(scene, std::move(ball), diffuse(), to_world);
  scene.lights = {sun(kGrazing)};
  return scene;
}

/// Two slips of paper that make the scene of radius 1 about the origin.
void widen(Scene& scene) {
  for (const double corner : {-1.0, 1.0}) {
    add_placed(scene, parallelogram(glm::dvec3(corner), {-corner * 1e-3, 0, 0}, {0, -corner * 1e-3, 0}), diffuse(),
               glm::dmat4(1.0));
  }
}

View view_of(const Scene& scene, const Placement& at, const glm::dvec3& eye) {
  Camera camera = look_at(at.center + at.size * eye, at.center + at.size * glm::dvec3(0, 0, 0.7), {0, 1, 0}, 0.8);
  std::get<PerspectiveLens>(camera.lens).near_distance = 0.1 * at.size;
  return make_view(camera, kPicture, scene.bounds);
}

/// Pixels of surfaces seen from their front that differ where shadow rays are traced although nothing is in their way.
/// (Past a silhouette that rounding has moved, a pixel may show the inside of the far side.)
std::size_t shadowed_pixels(Scene scene, const Placement& at, int threads) {
  finish_scene(scene);
  const View view = view_of(scene, at, {1.5, 1.0, 6.0});
  RaySettings settings;
  settings.threads = threads;
  settings.passes = {PassId::Shadow};
  const LitPicture shadowed = lit_picture(scene, view, settings);
  settings.passes = {};
  settings.auto_passes = false;
  const LitPicture open = lit_picture(scene, view, settings);
  const Surfaces surfaces(scene, RaySpace(scene));
  WorldTriangle triangle;
  std::size_t differing = 0;
  std::size_t lit = 0;
  for (int y = 0; y < kPicture.height; ++y) {
    for (int x = 0; x < kPicture.width; ++x) {
      const Key key = open.keys.at(0, x, y);
      if (key == kNoKey) continue;
      const Ray ray = view_ray(view, x + 0.5, y + 0.5);
      surfaces.load(key_surface(key), triangle);
      if (surfaces.meet(triangle, ray.origin, ray.direction).inside) continue;
      lit += open.image.at(x, y).r > 0.0F ? 1U : 0U;
      differing += open.image.at(x, y) == shadowed.image.at(x, y) ? 0U : 1U;
    }
  }
  return lit * 4 > kPicture.area() ? differing : kPicture.area();  // a picture of nothing proves nothing
}

std::size_t shadowed_in_a_wide_scene(double size, int threads) {
  const Placement at{size, {0.7, -0.6, 0.5}};
  Scene scene = grazed(at);
  widen(scene);
  return shadowed_pixels(std::move(scene), at, threads);
}

/// A floor of 2 by 2 radii under the sun, looked at from above.
class SunnyFloor {
 public:
  SunnyFloor(double size, int threads) : to_world_(shapes::placed({}, size)) {
    add_placed(floor_, parallelogram({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}), diffuse(), to_world_);
    floor_.lights = {sun(0.7)};
    finish_scene(floor_);
    view_ = view_of(floor_, {size, {}}, {0.2, 0.1, 2.5});
    settings_.threads = threads;
    keys_ = lit_picture(floor_, view_, settings_).keys;
    settings_.passes = {PassId::Shadow};
    shows_light_ = 4 * lit_pixels(floor_) > kPicture.area();
  }

  /// Pixels that see light although a cover lies `gap` radii above; all, where the bare floor is dark: that proves
  /// nothing.
  [[nodiscard]] std::size_t lit_under_cover(double gap) const {
    if (!shows_light_) return kPicture.area();
    Scene covered = floor_;
    add_placed(covered, parallelogram({-1.5, -1.5, gap}, {3, 0, 0}, {0, 3, 0}), diffuse(), to_world_);
    finish_scene(covered);
    return lit_pixels(covered);
  }

 private:
  /// What the floor's pixels show is named by keys, so that the cover does not hide it from the eye.
  [[nodiscard]] std::size_t lit_pixels(const Scene& scene) const {
    TileLayer<Rgb> radiance(keys_.layout());
    DeferredShader(scene, settings_)
        .shade(std::span(&view_, 1), keys_, all_tiles(keys_.layout()), {.radiance = &radiance});
    const Image<Rgb> image = to_image(radiance, 0);
    return static_cast<std::size_t>(
        std::ranges::count_if(image.pixels(), [](const Rgb& color) { return color.r > 0.0F; }));
  }

  glm::dmat4 to_world_;
  Scene floor_;
  View view_;
  RaySettings settings_;
  TileLayer<Key> keys_;
  bool shows_light_ = false;
};

std::vector<StabilityFinding> measure_acne(const Globals& globals) {
  const int threads = threads_of(globals);
  StabilityFinding terminator =
      make_finding("acne/terminator", "wall and smooth sphere lit at 89.9 degrees, scales 1e-3 .. 1e3", 0.0,
                   "shadowed pixels", "nothing stands in the light's way");
  StabilityFinding scales = make_finding("acne/offset-rule", "the same at scales 1e-9 .. 1e9", 0.0, "shadowed pixels",
                                         "origins move by 4 steps of the coordinates' own size, which scale along");
  scales.curve.x = "scale";
  for (const double scale : {1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9}) {
    const auto count = static_cast<double>(shadowed_pixels(grazed({scale, {}}), {scale, {}}, threads));
    if (scale >= 1e-3 && scale <= 1e3) terminator.measured = worse(terminator.measured, count);
    add_point(scales, scale, count);
  }

  StabilityFinding small =
      make_finding("acne/small-in-large", "the same, 1 .. 1e-4 scene radii large, away from the middle", 0.0,
                   "shadowed pixels", "origins move by more than Embree's test errs");
  small.curve.x = "size, in radii of the scene";
  for (const double size : {1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1}) {
    const auto count = static_cast<double>(shadowed_in_a_wide_scene(size, threads));
    add_point(small, size, count, size >= 1e-4);
  }
  const auto holds_small = [&](double size) { return shadowed_in_a_wide_scene(size, threads) == 0; };
  small.breaks_at = breaking_point_if_any(1e-4, 1e-8, 0.2, holds_small);

  // The floor's corners lie 1 radius off the middle, its edges are 2 long.
  constexpr double kOffset = kOriginSteps * kFloatStep * 3.0;
  StabilityFinding thin = make_finding(
      "acne/thin-wall", "floor under a cover 2.9e-6 (two offsets) .. 1e-2 radii above it, scales 1e-3 .. 1e3", 0.0,
      "lit pixels", "an origin is moved by 4 steps, and Embree errs by 3");
  thin.curve.x = "gap, in radii of the scene";
  const std::array floors{SunnyFloor(1e-3, threads), SunnyFloor(1.0, threads), SunnyFloor(1e3, threads)};
  const auto worst_lit = [&](double gap) {
    std::size_t lit = 0;
    for (const SunnyFloor& floor : floors) lit = std::max(lit, floor.lit_under_cover(gap));
    return static_cast<double>(lit);
  };
  for (const double gap : {0.5 * kOffset, kOffset, 2.0 * kOffset, 1e-4, 1e-2}) {
    const double lit = worst_lit(gap);
    add_point(thin, gap, lit, gap >= 2.0 * kOffset);
  }
  thin.breaks_at = breaking_point_if_any(2.0 * kOffset, 1e-9, 0.05, [&](double gap) { return worst_lit(gap) == 0.0; });
  return {terminator, scales, small, thin};
}

}  // namespace

StabilityCase acne_case() {
  return {"acne", "light at 89.9 degrees and covers close above floors: no false shadow, no leak", measure_acne};
}

}  // namespace hpr::stability
