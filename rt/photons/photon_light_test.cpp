#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "rt/photons/photon_query.h"
#include "rt/photons/test_photons.h"

// What photon maps bring to a picture, against brute force that knows nothing of photons.
namespace hpr {
namespace {

using test::PhotonRoom;

/// Finds what a ray meets and goes on from there, for the eye's side of the partition and for a path tracer.
class Eye {
 public:
  Eye(const PhotonRoom& room, double glossy_cutoff) : room_(room), caster_(room.scene), cutoff_(glossy_cutoff) {}

  struct Meeting {
    SurfacePoint surface;
    MaterialPoint material;
  };
  [[nodiscard]] std::optional<Meeting> meet(const glm::dvec3& origin, const glm::dvec3& direction) const {
    const test::Met met = caster_.cast(origin, direction);
    if (!std::isfinite(met.distance)) return std::nullopt;
    WorldTriangle triangle;
    room_.surfaces.load(met.surface, triangle);
    Meeting meeting;
    meeting.surface = room_.surfaces.meet(triangle, origin, direction);
    meeting.material = evaluate_material(room_.scene, meeting.surface);
    // Lamps of these rooms shine to their front only.
    if (meeting.surface.inside) meeting.material.emission = glm::dvec3(0.0);
    return meeting;
  }

  [[nodiscard]] bool visible(const glm::dvec3& from, const glm::dvec3& to) const {
    return caster_.cast(from, glm::normalize(to - from)).distance > glm::distance(from, to) - 1e-6;
  }

  [[nodiscard]] double cutoff() const { return cutoff_; }

  /// Chooses one of the lobes `wanted` says and goes on along it; none where the path ends.
  template <typename Wanted>
  std::optional<Lobe> go_on(const Meeting& at, const Bsdf& bsdf, Wanted&& wanted, Sampler& sampler,
                            glm::dvec3& throughput, glm::dvec3& origin, glm::dvec3& direction) const {
    std::array<double, 3> chances{};
    double total = 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
      const glm::dvec3 weight = bsdf.weight(kLobes[i]);
      if (wanted(kLobes[i])) chances[i] = weight.r + weight.g + weight.b;
      total += chances[i];
    }
    if (!(total > 0.0)) return std::nullopt;
    double left = sampler.one() * total;
    std::size_t chosen = 0;
    while (chosen < 2 && left >= chances[chosen]) left -= chances[chosen++];
    const auto sample = bsdf.sample(kLobes[chosen], sampler.two());
    if (!sample) return std::nullopt;
    throughput *= sample->weight * (total / chances[chosen]);
    direction = sample->direction;
    const double side = glm::dot(direction, at.surface.geometric_normal) < 0.0 ? -1.0 : 1.0;
    origin = at.surface.position + side * 1e-7 * at.surface.geometric_normal;
    return kLobes[chosen];
  }

 private:
  const PhotonRoom& room_;
  test::Caster caster_;
  double cutoff_;
};

/// A square lamp of radiance 1 that shines down.
constexpr double kLampHeight = 0.96;
constexpr double kLampHalf = 0.6;

/// What one place on the lamp, chosen evenly, gives by all lobes of more than one direction.
glm::dvec3 direct_light(const Eye& eye, const Eye::Meeting& at, const Bsdf& bsdf, Sampler& sampler) {
  const glm::dvec2 u = sampler.two();
  const glm::dvec3 goal(kLampHalf * (2.0 * u.x - 1.0), kLampHeight, kLampHalf * (2.0 * u.y - 1.0));
  const glm::dvec3& normal = at.surface.geometric_normal;
  const double side = glm::dot(goal - at.surface.position, normal) < 0.0 ? -1.0 : 1.0;
  const glm::dvec3 from = at.surface.position + side * 1e-7 * normal;
  const glm::dvec3 to_lamp = glm::normalize(goal - from);
  if (!(to_lamp.y > 0.0) || !eye.visible(from, goal)) return glm::dvec3(0.0);
  const double solid_angle = 4.0 * kLampHalf * kLampHalf * to_lamp.y / std::pow(glm::distance(from, goal), 2.0);
  glm::dvec3 value(0.0);
  for (const Lobe lobe : kLobes) value += bsdf.value(lobe, to_lamp);
  return value * (std::abs(glm::dot(to_lamp, at.material.normal)) * solid_angle);
}

/// Path tracing that samples the lamp and finds it by chance where followed lobes lead there. Without what the eye sees
/// of the lamp itself, also in mirrors: that is no photon's business.
glm::dvec3 by_chance(const Eye& eye, glm::dvec3 origin, glm::dvec3 direction, Sampler& sampler) {
  glm::dvec3 light(0.0);
  glm::dvec3 throughput(1.0);
  bool lit = false;
  bool followed = true;
  for (int bounce = 0; bounce < 64; ++bounce) {
    const auto at = eye.meet(origin, direction);
    if (!at) break;
    if (lit && followed) light += throughput * at->material.emission;
    const Bsdf bsdf(at->material, at->surface);
    light += throughput * direct_light(eye, *at, bsdf, sampler);
    const auto any = [](Lobe) { return true; };
    const auto lobe = eye.go_on(*at, bsdf, any, sampler, throughput, origin, direction);
    if (!lobe) break;
    followed = is_followed(bsdf, *lobe, eye.cutoff());
    lit = lit || !followed;
    if (bounce < 3) continue;
    const double survives = std::min(1.0, std::max({throughput.r, throughput.g, throughput.b}));
    if (sampler.one() >= survives) break;
    throughput /= survives;
  }
  return light;
}

glm::dvec3 by_photons(const Eye& eye, const PhotonMap& caustic, const PhotonMap& global, glm::dvec3 origin,
                      glm::dvec3 direction, Sampler& sampler) {
  FoundPhotons found;
  glm::dvec3 light(0.0);
  glm::dvec3 throughput(1.0);
  for (int bounce = 0; bounce < 64; ++bounce) {
    const auto at = eye.meet(origin, direction);
    if (!at) break;
    const Bsdf bsdf(at->material, at->surface);
    light += throughput * direct_light(eye, *at, bsdf, sampler);
    for (const PhotonMap* map : {&caustic, &global})
      light +=
          throughput * gather_photons(*map, map->radius(), at->surface, bsdf, at->material.normal, eye.cutoff(), found);
    const auto followed = [&](Lobe lobe) { return is_followed(bsdf, lobe, eye.cutoff()); };
    if (!eye.go_on(*at, bsdf, followed, sampler, throughput, origin, direction)) break;
  }
  return light;
}

PhotonSource lamp() {
  return [](double /*u_choice*/, const glm::dvec2& u_place, const glm::dvec2& u_direction) {
    PhotonStart start;
    start.origin = {kLampHalf * (2.0 * u_place.x - 1.0), kLampHeight, kLampHalf * (2.0 * u_place.y - 1.0)};
    start.direction = test::cosine_direction({0.0, -1.0, 0.0}, u_direction);
    start.flux = glm::dvec3(std::numbers::pi * 4.0 * kLampHalf * kLampHalf);
    start.surface = 12;
    start.offset = 1e-6;
    return std::optional(start);
  };
}

/// A room of twelve triangles, red and green left and right, with a lamp and one object.
PhotonRoom cornell(const Material& object_material, bool cube) {
  Scene scene;
  const std::uint32_t white = test::add_material(scene, test::diffuse(glm::vec3(0.75F)));
  const std::uint32_t red = test::add_material(scene, test::diffuse({0.6F, 0.1F, 0.1F}));
  const std::uint32_t green = test::add_material(scene, test::diffuse({0.1F, 0.5F, 0.1F}));
  const std::uint32_t light = test::add_material(scene, test::glowing(glm::vec3(1.0F)));
  const std::uint32_t object = test::add_material(scene, object_material);
  test::add_room(scene, white);
  scene.meshes[0].material = red;
  scene.meshes[1].material = green;
  const auto height = static_cast<float>(kLampHeight);
  const auto half = static_cast<float>(kLampHalf);
  test::place_mesh(
      scene, test::add_mesh(scene, test::quad({-half, height, -half}, {2 * half, 0, 0}, {0, 0, 2 * half}, light)));
  if (!cube) {
    test::place_mesh(
        scene, test::add_mesh(scene, test::quad({-0.7F, -0.95F, -0.4F}, {1.2F, 0, -0.3F}, {0, 1.3F, -0.2F}, object)));
    return PhotonRoom(std::move(scene));
  }
  Scene walls;
  test::add_room(walls, object);
  const glm::dmat3 axes = 0.4 * look_at({0.5, 0.0, 0.3}, {0.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, 1.0).axes;
  for (Mesh& wall : walls.meshes) {
    for (glm::uvec3& triangle : wall.triangles) std::swap(triangle.x, triangle.y);
    for (glm::vec3& normal : wall.normals) normal = -normal;
    glm::dmat4 to_world(axes);
    to_world[3] = {0.1, -0.4, 0.0, 1.0};
    test::place_mesh(scene, test::add_mesh(scene, wall), to_world);
  }
  return PhotonRoom(std::move(scene));
}

/// Short: near corners a gather misses the light of the part of its circle that lies behind the wall. What noise that
/// leaves goes with the mean over the picture.
constexpr double kGatherRadius = 0.008;

struct Means {
  std::size_t caustic_photons = 0;
  glm::dvec3 chance{0.0};
  glm::dvec3 photons{0.0};
};

Means compare(const PhotonRoom& room, double cutoff, std::uint64_t photons) {
  const Eye eye(room, cutoff);
  const TracedPhotons traced = room.trace(lamp(), photons, {.glossy_cutoff = cutoff});
  const PhotonMap caustic(traced.caustic, room.space, kGatherRadius);
  const PhotonMap global(traced.global, room.space, kGatherRadius);
  constexpr int kSide = 16;
  constexpr std::uint32_t kPaths = 800;
  constexpr std::uint32_t kLooks = 96;
  const View view = test::view_from({0.0, 0.0, 0.95}, {0.0, -0.1, 0.0}, {kSide, kSide}, room.scene, 1.5);
  Means means;
  means.caustic_photons = traced.caustic.size();
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const auto ray_of = [&](Sampler& sampler) {
        const glm::dvec2 u = sampler.two();
        return view_ray(view, x + u.x, y + u.y);
      };
      for (std::uint32_t i = 0; i < kPaths; ++i) {
        Sampler sampler(pixel_stream({.seed = 3}, 0, x, y), i);
        const Ray ray = ray_of(sampler);
        means.chance += by_chance(eye, ray.origin, ray.direction, sampler) / double{kPaths};
      }
      for (std::uint32_t i = 0; i < kLooks; ++i) {
        Sampler sampler(pixel_stream({.seed = 4}, 0, x, y), i);
        const Ray ray = ray_of(sampler);
        means.photons += by_photons(eye, caustic, global, ray.origin, ray.direction, sampler) / double{kLooks};
      }
    }
  }
  return means;
}

void expect_within_a_percent(const Means& means) {
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(means.photons[c], means.chance[c], 0.01 * means.chance[c]) << "channel " << c;
}

TEST(PhotonLightTest, ARoomWithAMirrorHasTheBrightnessOfBruteForce) {
  const Means means = compare(cornell(test::mirror(0.9F), false), 0.25, 400000);
  expect_within_a_percent(means);
  EXPECT_GT(means.caustic_photons, 10000U);
}

TEST(PhotonLightTest, ARoomWithAGlassCubeHasTheBrightnessOfBruteForce) {
  const Means means = compare(cornell(test::clear_glass(), true), 0.25, 400000);
  expect_within_a_percent(means);
  EXPECT_GT(means.caustic_photons, 10000U);
}

TEST(PhotonLightTest, ARoughMetalTakesItsReflectionsFromPhotons) {
  Material metal = test::mirror(0.9F);
  metal.roughness = 0.6F;
  expect_within_a_percent(compare(cornell(metal, false), 0.25, 400000));
}

/// Light of photons alone, where a series says how bright all is.
class PhotonFurnace : public testing::TestWithParam<double> {};

TEST_P(PhotonFurnace, IsAsBrightAsItsSeriesSums) {
  test::expect_light_of_series(GetParam(), {.photons = 100'000, .global_photons = true}, 32);
}

INSTANTIATE_TEST_SUITE_P(Albedos, PhotonFurnace, testing::Values(0.5, 0.8));

}  // namespace
}  // namespace hpr
