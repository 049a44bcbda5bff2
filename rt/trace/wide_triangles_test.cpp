#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <string>
#include <vector>

#include "rt/reference/test_paths.h"
#include "rt/sampling/sampler.h"
#include "rt/sampling/sampling.h"
#include "rt/test_scene.h"
#include "rt/trace/primary_rays.h"
#include "rt/trace/refined_triangles.h"
#include "rt/trace/surfaces.h"

/// Grounds of two triangles that are far wider than what stands on them: what is met beside the diagonal that the two
/// share, and what rays that begin there meet.
namespace hpr {
namespace {

enum class Kind { Own, Scaled, Halves };

struct Ground {
  double half_size = 0.0;
  int turn = 0;  ///< 0: level; 1, 2: upright; else a seed
  Kind kind = Kind::Own;
  glm::dvec3 things{0.0};  ///< where on it they stand
};

std::string name_of(const Ground& ground) {
  const std::array<const char*, 3> kinds{"its own mesh", "a shared mesh", "a mesh a triangle"};
  return std::to_string(ground.half_size) + " m, turn " + std::to_string(ground.turn) + ", " +
         kinds.at(static_cast<std::size_t>(ground.kind));
}

std::vector<Ground> grounds() {
  std::vector<Ground> all;
  for (const double half_size : {1e3, 1e4, 1e5, 1e6, 1e7}) {
    for (const int turn : {0, 1, 2, 7, 8}) all.push_back({half_size, turn, Kind::Own});
    for (const int turn : {0, 7}) all.push_back({half_size, turn, Kind::Scaled});
    for (const int turn : {0, 7}) all.push_back({half_size, turn, Kind::Halves});
  }
  return all;
}

glm::dmat4 turned(const Ground& ground) {
  const glm::dmat4 one(1.0);
  if (ground.turn == 0) return one;
  if (ground.turn <= 2) return glm::rotate(one, glm::radians(90.0), glm::dvec3(ground.turn == 1, 0, ground.turn == 2));
  Sampler sampler(static_cast<std::uint64_t>(ground.turn), 0);
  const glm::dvec3 axis = warp::on_sphere(sampler.two());
  return glm::rotate(one, 6.0 * sampler.one(), axis);
}

/// Whose surfaces 0 and 1 are the ground: colours and texture coordinates are linear over both.
Scene make_scene(const Ground& ground, const Material& of_ground, const Material& of_ball) {
  Scene scene;
  const std::uint32_t used = test::add_material(scene, of_ground);
  const glm::dmat4 turn = turned(ground);
  const bool is_scaled = ground.kind == Kind::Scaled;
  const auto size = static_cast<float>(is_scaled ? 1.0 : ground.half_size);
  Mesh wide = test::quad({-size, 0, -size}, {0, 0, 2 * size}, {2 * size, 0, 0}, used);
  for (const glm::vec2& uv : wide.uvs[0]) wide.colors.emplace_back(0.25F + 0.5F * uv.x, 0.5F, 0.5F, 1.0F);
  if (ground.kind == Kind::Halves) {
    Mesh half = wide;
    half.triangles = {wide.triangles[0]};
    test::place_mesh(scene, test::add_mesh(scene, half), turn);
    half.triangles = {wide.triangles[1]};
    test::place_mesh(scene, test::add_mesh(scene, half), turn);
  } else {
    const std::uint32_t mesh = test::add_mesh(scene, wide);
    const glm::dmat4 scaled = glm::scale(turn, glm::dvec3(is_scaled ? ground.half_size : 1.0));
    test::place_mesh(scene, mesh, scaled);
    if (is_scaled) {
      const glm::dvec3 at = ground.things + glm::dvec3(-1.0, 0.6, -1.0);
      test::place_mesh(scene, mesh, glm::scale(glm::translate(turn, at), glm::dvec3(0.2)));
    }
  }
  const std::uint32_t ball = test::add_material(scene, of_ball);
  test::place_mesh(scene, test::add_mesh(scene, test::sphere(0.5, 16, ball)),
                   glm::translate(turn, ground.things + glm::dvec3(0.0, 0.5, 0.0)));
  Light lamp;
  lamp.type = LightType::Point;
  lamp.intensity = glm::vec3(30.0F);
  lamp.position = glm::dvec3(turn * glm::dvec4(ground.things + glm::dvec3(2.0, 3.0, 1.0), 1.0));
  scene.lights.push_back(lamp);
  finish_scene(scene);
  return scene;
}

TEST(WideTriangles, AreMetWhereRaysMeetTheirPlane) {
  constexpr std::size_t kRays = 2000;
  for (const Ground& ground : grounds()) {
    SCOPED_TRACE(name_of(ground));
    const Scene scene = make_scene(ground, test::diffuse(), test::diffuse());
    const RaySpace space(scene);
    const RayScene rays(scene, space, 1);
    const Surfaces surfaces(scene, space);
    const glm::dmat4 turn = turned(ground);
    const auto in_world = [&](const glm::dvec3& at, double w = 1.0) { return glm::dvec3(turn * glm::dvec4(at, w)); };
    RayBatch batch;
    std::vector<glm::dvec3> eyes;
    std::vector<glm::dvec3> targets;
    for (std::uint32_t i = 0; i < kRays; ++i) {
      Sampler sampler(5, i);
      const double along = 8.0 * sampler.one() - 4.0;
      const double beside = std::pow(10.0, -6.0 * sampler.one()) * (i % 2 == 0 ? 1.0 : -1.0);
      targets.push_back({along, 0.0, along + beside});
      eyes.push_back(targets.back() + glm::dvec3(2.0 * sampler.one() - 1.0, 2.0, 4.0 * sampler.one()));
      if (glm::length(targets.back() - glm::dvec3(0.0, 0.5, 0.0)) < 3.0) eyes.back().y = 0.1;  // below the ball
      batch.push(space.from_world(in_world(eyes.back())), glm::normalize(in_world(targets.back() - eyes.back(), 0.0)),
                 HUGE_VAL);
    }
    std::vector<std::uint32_t> met(kRays);
    EXPECT_EQ(rays.closest(batch, met), 0U);
    std::size_t grounds_met = 0;
    double farthest = 0.0;
    double uv_error = 0.0;
    for (std::size_t i = 0; i < kRays; ++i) {
      if (met[i] > 1) continue;
      ++grounds_met;
      WorldTriangle triangle;
      surfaces.load(met[i], triangle);
      const SurfacePoint point = surfaces.meet(triangle, in_world(eyes[i]), in_world(targets[i] - eyes[i], 0.0));
      farthest = std::max(farthest, glm::distance(point.position, in_world(targets[i])));
      const glm::dvec2 uv(0.5 + 0.5 * targets[i].z / ground.half_size, 0.5 + 0.5 * targets[i].x / ground.half_size);
      uv_error = std::max({uv_error, std::abs(static_cast<double>(point.uv[0].x) - uv.x),
                           std::abs(static_cast<double>(point.uv[0].y) - uv.y)});
      EXPECT_NEAR(point.color.r, 0.25 + 0.5 * uv.x, 1e-6);
    }
    EXPECT_GT(grounds_met, kRays / 2);
    EXPECT_LT(farthest, 2e-14 * ground.half_size + 1e-9);
    EXPECT_LT(uv_error, 6.1e-8);
  }
}

TEST(WideTriangles, AreLeftByRaysFromBesideTheirEdge) {
  for (const Ground& ground : grounds()) {
    SCOPED_TRACE(name_of(ground));
    const Scene scene = make_scene(ground, test::diffuse(), test::diffuse());
    const RaySpace space(scene);
    const RayScene rays(scene, space, 1);
    const Surfaces surfaces(scene, space);
    const glm::dmat4 turn = turned(ground);
    const glm::dvec3 up(turn * glm::dvec4(0.0, 1.0, 0.0, 0.0));
    RayBatch away;
    RayBatch under;  // the ball
    constexpr std::size_t kRays = 2000;
    for (std::uint32_t i = 0; i < kRays; ++i) {
      Sampler sampler(6, i);
      const double beside = std::pow(10.0, -6.0 * sampler.one()) * (i % 2 == 0 ? 1.0 : -1.0);
      const auto leave = [&](double along, const glm::dvec3& direction, RayBatch& batch) {
        const glm::dvec3 target(turn * glm::dvec4(along, 0.0, along + 0.1 * beside, 1.0));
        WorldTriangle triangle;
        surfaces.load(beside > 0.0 ? 0 : 1, triangle);
        const SurfacePoint point = surfaces.meet(triangle, target + up, -up);
        EXPECT_LT(point.offset, 1e-3);
        batch.push(space.from_world(ray_origin(point, direction)), direction, HUGE_VAL);
      };
      glm::dvec3 direction = warp::on_sphere(sampler.two());
      if (glm::dot(direction, up) < 0.0) direction = -direction;
      leave(8.0 * sampler.one() - 4.0, direction, away);
      leave(0.4 * sampler.one() - 0.2, up, under);
    }
    std::vector<std::uint32_t> met(kRays);
    EXPECT_EQ(rays.closest(away, met), 0U);
    EXPECT_EQ(std::ranges::count_if(met, [](std::uint32_t surface) { return surface < 2; }), 0);
    std::vector<std::uint8_t> blocked(kRays);
    EXPECT_EQ(rays.occluded(under, blocked), 0U);
    EXPECT_EQ(std::ranges::count(blocked, 1), static_cast<std::ptrdiff_t>(kRays));
  }
}

View view_of(const Scene& scene, const Ground& ground) {
  const glm::dmat4 turn = turned(ground);
  const auto in_world = [&](double x, double y, double z, double w) {
    return glm::dvec3(turn * glm::dvec4(w * ground.things + glm::dvec3(x, y, z), w));
  };
  return test::view_from(in_world(1.0, 1.5, 4.0, 1.0), in_world(0.0, 0.3, 0.0, 1.0), {80, 45}, scene, 0.8,
                         in_world(0.0, 1.0, 0.0, 0.0));
}

Image<Rgb> by_passes(const Scene& scene, const Ground& ground) {
  const View view = view_of(scene, ground);
  const RayScene rays(scene, RaySpace(scene), 1);
  TileLayer<Key> keys(FrameLayout({view.size()}));
  PrimaryRays(scene, rays, 1).draw(view, 0, std::array{Rect{0, 0, 80, 45}}, keys);
  TileLayer<Rgb> radiance(keys.layout());
  DeferredShader shader(scene, {.passes = {PassId::Shadow, PassId::Reflection}});
  shader.shade(std::span(&view, 1), keys, all_tiles(keys.layout()), {.radiance = &radiance});
  return to_image(radiance, 0);
}

Image<Rgb> by_paths(const Scene& scene, const Ground& ground) {
  return test::trace(test::PathBench(scene), view_of(scene, ground), {.max_depth = 3});
}

/// Pixels that differ by more than a hundredth.
std::size_t differing(const Image<Rgb>& a, const Image<Rgb>& b) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < a.pixels().size(); ++i) {
    if (std::abs(a.pixels()[i].g - b.pixels()[i].g) > 0.01F) ++count;
  }
  return count;
}

TEST(WideTriangles, MatchTheImagesOfASmallGround) {
  const Material dull = test::diffuse(glm::vec3(0.8F));
  for (const auto& [of_ground, of_ball] : {std::pair(dull, test::mirror(0.8F)), std::pair(test::mirror(0.8F), dull)}) {
    for (const Ground& ground : grounds()) {
      if (ground.half_size != 1e4 && ground.half_size < 1e6) continue;
      SCOPED_TRACE(name_of(ground));
      const Ground small{60.0, ground.turn, ground.kind};
      const Scene expected = make_scene(small, of_ground, of_ball);
      const Scene scene = make_scene(ground, of_ground, of_ball);
      EXPECT_EQ(differing(by_passes(expected, small), by_passes(scene, ground)), 0U);
      EXPECT_EQ(differing(by_paths(expected, small), by_paths(scene, ground)), 0U);
    }
  }
}

TEST(WideTriangles, MatchTheImagesOfASmallGroundWhereThingsStandFarFromTheirMiddle) {
  for (Ground ground : grounds()) {
    if (ground.half_size < 1e6 || ground.turn == 1 || ground.turn == 2) continue;
    SCOPED_TRACE(name_of(ground));
    const Ground small{60.0, ground.turn, ground.kind};
    ground.things = ground.half_size * glm::dvec3(0.6, 0.0, -0.3);
    const Scene expected = make_scene(small, test::diffuse(), test::mirror(0.8F));
    const Scene scene = make_scene(ground, test::diffuse(), test::mirror(0.8F));
    EXPECT_EQ(differing(by_passes(expected, small), by_passes(scene, ground)), 0U);
    EXPECT_EQ(differing(by_paths(expected, small), by_paths(scene, ground)), 0U);
  }
}

/// Of two groups of things on one ground floats are fine about one of them. About the other, rays are right but for
/// RaySpace::rounding_at.
TEST(WideTriangles, RoundThingsThatStandFarFromTheOthersByNoMoreThanIsSaid) {
  for (const double half_size : {1e4, 1e5, 1e6}) {
    SCOPED_TRACE(half_size);
    Scene scene = make_scene({half_size, 0, Kind::Own}, test::diffuse(), test::diffuse());
    const glm::dvec3 corner = half_size * glm::dvec3(0.31, 0.0, 0.63);
    test::place_mesh(scene, test::add_mesh(scene, test::quad({0, 0, 0}, {2, 0, 0}, {0, 2, 0}, 0)),
                     glm::translate(glm::dmat4(1.0), corner));
    finish_scene(scene);
    const RaySpace space(scene);
    const RayScene rays(scene, space, 1);
    const double bound = space.rounding_at(corner);
    EXPECT_LT(bound, 4e-7 * half_size);
    const auto wrong_at = [&](double margin) {
      RayBatch batch;
      constexpr std::size_t kRays = 2000;
      for (std::uint32_t i = 0; i < kRays; ++i) {
        Sampler sampler(7, i);
        const glm::dvec3 target = corner + glm::dvec3(i % 2 == 0 ? margin : -margin, 0.5 + sampler.one(), 0.0);
        const glm::dvec3 from(sampler.one() - 0.5, sampler.one() - 0.5, 3.0);
        batch.push(space.from_world(target + from), glm::normalize(-from), 4.0 * space.scale);
      }
      std::vector<std::uint8_t> blocked(kRays);
      EXPECT_EQ(rays.occluded(batch, blocked), 0U);
      std::size_t wrong = 0;
      for (std::size_t i = 0; i < kRays; ++i) wrong += (blocked[i] != 0) != (i % 2 == 0) ? 1U : 0U;
      return wrong;
    };
    EXPECT_EQ(wrong_at(bound), 0U);
    EXPECT_GT(wrong_at(bound / 64.0), 0U);
  }
}

TEST(WideTriangles, HaveExactDepthsBesideTheirEdge) {
  for (const Ground& ground : grounds()) {
    SCOPED_TRACE(name_of(ground));
    const Scene scene = make_scene(ground, test::diffuse(), test::diffuse());
    const View view = view_of(scene, ground);
    const RayScene rays(scene, RaySpace(scene), 1);
    TileLayer<Key> keys(FrameLayout({view.size()}));
    PrimaryRays(scene, rays, 1).draw(view, 0, std::array{Rect{0, 0, 80, 45}}, keys);
    const glm::dvec3 up(turned(ground) * glm::dvec4(0.0, 1.0, 0.0, 0.0));
    std::size_t seen = 0;
    for (int y = 0; y < 45; ++y) {
      for (int x = 0; x < 80; ++x) {
        const Key key = keys.at(0, x, y);
        if (key == kNoKey || key_surface(key) > 1) continue;
        ++seen;
        const Ray ray = view_ray(view, x + 0.5, y + 0.5);
        const double along = -glm::dot(ray.origin, up) / glm::dot(ray.direction, up);
        EXPECT_NEAR(key_depth(key) / reversed_depth(view, along), 1.0, 2e-7) << x << ' ' << y;
      }
    }
    EXPECT_GT(seen, 1000U);
  }
}

/// Where floats hold positions no better than to decimeters, a ray meets one triangle or the other by chance, but the
/// plane where it does.
TEST(WideTriangles, AreMetFarFromTheirMiddleToo) {
  for (const Kind kind : {Kind::Own, Kind::Scaled, Kind::Halves}) {
    const Ground ground{1e6, 0, kind};
    SCOPED_TRACE(name_of(ground));
    const Scene scene = make_scene(ground, test::diffuse(), test::diffuse());
    const glm::dvec3 target(3e5, 0.0, 3e5);
    const View view =
        test::view_from(target + glm::dvec3(0.4, 1.5, 2.0), target + glm::dvec3(0.0, 0.0, 0.0), {80, 45}, scene);
    const RayScene rays(scene, RaySpace(scene), 1);
    const Surfaces surfaces(scene, RaySpace(scene));
    TileLayer<Key> keys(FrameLayout({view.size()}));
    PrimaryRays(scene, rays, 1).draw(view, 0, std::array{Rect{0, 0, 80, 45}}, keys);
    for (int y = 5; y < 45; ++y) {
      for (int x = 0; x < 80; ++x) {
        const Key key = keys.at(0, x, y);
        ASSERT_LT(key_surface(key), 2U);
        const Ray ray = view_ray(view, x + 0.5, y + 0.5);
        const double along = -ray.origin.y / ray.direction.y;
        EXPECT_NEAR(key_depth(key) / reversed_depth(view, along), 1.0, 2e-7) << x << ' ' << y;
        WorldTriangle triangle;
        surfaces.load(key_surface(key), triangle);
        const glm::dvec3 position = surfaces.meet(triangle, ray.origin, ray.direction).position;
        EXPECT_LT(glm::distance(position, ray.origin + along * ray.direction), 1e-8);
      }
    }
  }
}

}  // namespace
}  // namespace hpr
