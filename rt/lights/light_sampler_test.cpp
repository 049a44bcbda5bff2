#include "rt/lights/light_sampler.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <numbers>

#include "rt/sampling/sampler.h"
#include "rt/test_scene.h"

namespace hpr {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr glm::dvec3 kUp(0, 0, 1);

Light lamp(const glm::dvec3& position, float intensity, double radius = 0.0) {
  Light light;
  light.position = position;
  light.intensity = glm::vec3(intensity);
  light.radius = radius;
  return light;
}

/// A floor, some emitting triangles over it, and whatever is added.
Scene hall(int lamps = 20) {
  Scene scene;
  const std::uint32_t floor = test::add_material(scene, test::diffuse());
  const std::uint32_t glow = test::add_material(scene, test::glowing({2.0F, 4.0F, 6.0F}));
  test::place_mesh(scene, test::add_mesh(scene, test::quad({-10, -10, 0}, {20, 0, 0}, {0, 20, 0}, floor)));
  const std::uint32_t panel = test::add_mesh(scene, test::quad({0, 0, 0}, {0.5, 0, 0}, {0, 0.5, 0.2}, glow));
  for (int i = 0; i < lamps; ++i) {
    const glm::dvec3 at(-9.0 + i % 5 * 4.0, -9.0 + i / 5 * 3.0, 2.0 + 0.1 * i);
    test::place_mesh(scene, panel, glm::rotate(glm::translate(glm::dmat4(1.0), at), 0.3 * i, glm::dvec3(1, 0, 0)));
  }
  finish_scene(scene);
  return scene;
}

Environment sky() {
  Environment environment{Image<Rgb>({16, 8}, {0.1F, 0.2F, 0.4F})};
  environment.image.at(4, 2) = {50.0F, 40.0F, 20.0F};
  return environment;
}

/// The irradiance on the floor at `place` with nothing in the way.
glm::dvec3 estimate(const LightSampler& lights, const glm::dvec3& position, std::uint32_t samples, bool any) {
  glm::dvec3 sum(0.0);
  for (std::uint32_t i = 0; i < samples; ++i) {
    Sampler sampler(11, i);
    const double u = sampler.one();
    const auto sample = any ? lights.sample_any(position, kUp, View{}, u, sampler.two())
                            : lights.sample(position, kUp, View{}, u, sampler.two());
    if (sample) sum += sample->weight * std::max(0.0, sample->to_light.z);
    if (any) continue;
    for (std::size_t light = 0; light < lights.enumerated(); ++light) {
      const LightSample of_light = lights.sample_enumerated(light, position, View{}, sampler.two());
      sum += of_light.weight * std::max(0.0, of_light.to_light.z);
    }
  }
  return sum / static_cast<double>(samples);
}

TEST(LightSampler, ASceneWithoutLightGetsAHeadlightThatSendsNoPhotons) {
  Scene scene = hall(0);
  const LightSampler lights(scene);
  ASSERT_EQ(lights.enumerated(), 1U);
  EXPECT_TRUE(lights.enumerated_is_fixed(0));
  EXPECT_FALSE(lights.has_tree());
  View view;
  view.eye = {0, 0, 9};
  const LightSample sample = lights.sample_enumerated(0, glm::dvec3(0.0), view, {});
  EXPECT_FALSE(sample.casts_shadows);
  EXPECT_NEAR(sample.weight.r, kPi, 1e-6);
  EXPECT_GT(sample.to_light.z, 0.85);
  const auto any = lights.sample_any(glm::dvec3(0.0), kUp, view, 0.5, {});
  ASSERT_TRUE(any.has_value());
  EXPECT_EQ(any->weight, sample.weight);
  EXPECT_FALSE(lights.emit(0.5, {0.5, 0.5}, {0.5, 0.5}).has_value());
  EXPECT_EQ(lights.power(), 0.0);
  EXPECT_EQ(LightSampler(hall(1)).enumerated(), 0U) << "an emitting surface takes its place";
}

TEST(LightSampler, FewPunctualLightsAreListedAndManyAreSampled) {
  Scene scene = hall(1);
  for (std::size_t i = 0; i < LightSampler::kMaxEnumerated; ++i)
    scene.lights.push_back(lamp({0.1 * static_cast<double>(i), 0, 2}, 1.0F, 0.1));
  scene.lights.push_back(lamp({0, 0, 5}, 0.0F));
  const LightSampler few(scene);
  EXPECT_EQ(few.enumerated(), LightSampler::kMaxEnumerated) << "the one without intensity isn't there";
  EXPECT_FALSE(few.enumerated_is_fixed(0));
  EXPECT_TRUE(few.has_tree());
  scene.lights.push_back(lamp({0, 0, 3}, 1.0F));
  EXPECT_EQ(LightSampler(scene).enumerated(), 0U);
}

TEST(LightSampler, AllWaysToAskGiveTheSameLight) {
  Scene scene = hall();
  scene.environment = sky();
  scene.lights = {lamp({1, 2, 3}, 30.0F), lamp({-3, 1, 2}, 20.0F, 0.5), lamp({}, 2.0F)};
  scene.lights[2].type = LightType::Directional;
  scene.lights[2].direction = {0, 0, -1};
  constexpr std::uint32_t kSamples = 65536;
  for (const glm::dvec3 position : {glm::dvec3(0, 0, 0.01), glm::dvec3(8, -7, 0.5)}) {
    const LightSampler lights(scene);
    const glm::dvec3 one = estimate(lights, position, kSamples, false);
    const glm::dvec3 any = estimate(lights, position, kSamples, true);
    Scene many = scene;
    for (int i = 0; i < 100; ++i) many.lights.push_back(lamp({0, 0, 9}, 1e-9F));
    const LightSampler unlisted(many);
    ASSERT_EQ(unlisted.enumerated(), 0U);
    const glm::dvec3 sampled = estimate(unlisted, position, kSamples, false);
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(any[c] / one[c], 1.0, 0.01) << c;
      EXPECT_NEAR(sampled[c] / one[c], 1.0, 0.01) << c;
    }
  }
}

TEST(LightSampler, DensitiesFoundBackwardsAreThoseOfTheSamples) {
  Scene scene = hall();
  scene.environment = sky();
  scene.environment->scale = 0.02;  // so that triangles are chosen as well
  scene.lights = {lamp({1, 2, 3}, 30.0F), lamp({-3, 1, 2}, 20.0F, 0.5)};
  scene.lights.push_back(lamp({}, 0.01F));
  scene.lights.back().type = LightType::Directional;
  const LightSampler lights(scene);
  const Surfaces surfaces(scene, RaySpace(scene));
  int triangles = 0;
  int outside = 0;
  for (std::uint32_t i = 0; i < 30'000; ++i) {
    Sampler sampler(13, i);
    const glm::dvec3 position(8.0 * sampler.one() - 4.0, 8.0 * sampler.one() - 4.0, 4.0 * sampler.one());
    const glm::dvec3 normal = i % 4 == 0 ? glm::dvec3(0.0) : glm::normalize(glm::dvec3(sampler.one(), 0.2, 0.5));
    const bool any = i % 2 == 0;
    const double u = sampler.one();
    const auto sample = any ? lights.sample_any(position, normal, View{}, u, sampler.two())
                            : lights.sample(position, normal, View{}, u, sampler.two());
    if (!sample || sample->pdf == 0.0) continue;
    if (std::isinf(sample->distance)) {
      ++outside;
      EXPECT_EQ(any ? lights.environment_pdf_any(position, normal, sample->to_light)
                    : lights.environment_pdf(position, normal, sample->to_light),
                sample->pdf);
      continue;
    }
    ++triangles;
    // The surface is the one whose plane and extent the goal lies on.
    double best = 0.0;
    SurfacePoint hit;
    hit.position = sample->goal;
    WorldTriangle triangle;
    double nearest = std::numeric_limits<double>::infinity();
    for (std::uint32_t id = 2; id < scene.triangles; ++id) {
      surfaces.load(id, triangle);
      const SurfacePoint met = surfaces.meet(triangle, position, sample->to_light);
      const double off = glm::distance(met.position, sample->goal);
      if (off >= nearest) continue;
      nearest = off;
      best = any ? lights.surface_pdf_any(position, normal, id, hit) : lights.surface_pdf(position, normal, id, hit);
    }
    if (nearest > 1e-9) continue;
    EXPECT_NEAR(best / sample->pdf, 1.0, 1e-9) << nearest;
    EXPECT_EQ(lights.surface_pdf_any(position, normal, 0, hit), 0.0) << "the floor does not emit";
  }
  EXPECT_GT(triangles, 10'000);
  EXPECT_GT(outside, 2000);
}

TEST(LightSampler, TheEnvironmentsDensitiesSumToOneOverItsTexels) {
  Scene scene = hall(0);
  scene.environment = sky();
  const LightSampler lights(scene);
  double sum = 0.0;
  for (int y = 0; y < 8; ++y) {
    const double center = kPi * (y + 0.5) / 8.0;
    const double solid_angle = 2.0 * kPi / 16.0 * (std::cos(kPi * y / 8.0) - std::cos(kPi * (y + 1) / 8.0));
    for (int x = 0; x < 16; ++x) {
      const double angle = 2.0 * kPi * ((x + 0.5) / 16.0 - 0.5);
      const glm::dvec3 w(std::sin(center) * std::sin(angle), std::cos(center), -std::sin(center) * std::cos(angle));
      sum += lights.environment_pdf(glm::dvec3(0.0), glm::dvec3(0.0), w) * solid_angle;
    }
  }
  EXPECT_NEAR(sum, 1.0, 1e-12);
}

/// The relative standard deviation, over samples, of what an open sky sends to a matte surface.
double spread_of_sky(const Environment& environment, const glm::dvec3& normal) {
  Scene scene = hall(0);
  scene.environment = environment;
  const LightSampler lights(scene);
  double sum = 0.0;
  double squares = 0.0;
  constexpr std::uint32_t kSamples = 16384;
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    Sampler sampler(5, i);
    const double u = sampler.one();
    const auto sample = lights.sample({0, 0, 1}, normal, View{}, u, sampler.two());
    const double irradiance = sample ? sample->weight.g * std::max(0.0, glm::dot(normal, sample->to_light)) : 0.0;
    sum += irradiance;
    squares += irradiance * irradiance;
  }
  return std::sqrt(std::max(0.0, squares / kSamples / (sum * sum / kSamples / kSamples) - 1.0));
}

TEST(LightSampler, MatteSurfacesUnderAnEvenSkySeeNoNoise) {
  const glm::dvec3 normal = glm::normalize(glm::dvec3(0.3, -0.2, 0.8));
  EXPECT_LT(spread_of_sky(Environment{Image<Rgb>({1, 1}, {2, 2, 2})}, normal), 1e-7);
  EXPECT_LT(spread_of_sky(Environment{Image<Rgb>({8, 4}, {2, 2, 2})}, normal), 1e-7);
  Environment clouds{Image<Rgb>({8, 4}, {2, 2, 2})};
  for (int x = 0; x < 8; x += 2) clouds.image.at(x, 1) = {1, 1, 1};
  EXPECT_LT(spread_of_sky(clouds, normal), 0.4) << "by brightness alone it is 1.3";
  Environment sun{Image<Rgb>({64, 32}, {0.01F, 0.01F, 0.01F})};
  sun.image.at(20, 9) = {1e4F, 1e4F, 1e4F};
  const glm::dvec3 to_sun = EnvironmentMap(sun).sample(glm::dvec3(0.0), 0.0, {0.5, 0.5}).value();
  EXPECT_LT(spread_of_sky(sun, to_sun), 1.5) << "by the cosine alone it is above 10";
}

TEST(LightSampler, TheBackgroundIsSeenButLightsNothing) {
  Scene scene = hall(1);
  scene.background = {0.5F, 0.6F, 0.7F};
  const LightSampler lights(scene);
  EXPECT_NEAR(lights.environment({0, 1, 0}).g, 0.6, 1e-7);
  EXPECT_EQ(lights.environment_pdf_any(glm::dvec3(0.0), kUp, {0, 1, 0}), 0.0);
  scene.environment = Environment{Image<Rgb>({1, 1}, {9, 9, 9})};
  EXPECT_NEAR(LightSampler(scene).environment({0, 1, 0}).g, 9.0, 1e-12);
}

TEST(LightSampler, NothingIsNanWhateverTheLights) {
  Scene scene = hall(2);
  scene.environment = Environment{Image<Rgb>({3, 2})};
  scene.lights = {lamp({0, 0, 0}, 1.0F), lamp({0, 0, 0}, 0.0F), lamp({0, 0, 0}, 1.0F, 1e-6),
                  lamp({1e6, 0, 0}, 1.0F, 1e6), lamp({0, 0, 1}, std::numeric_limits<float>::infinity())};
  scene.lights.push_back(lamp({0, 0, 0}, 1.0F));
  scene.lights.back().type = LightType::Spot;
  test::place_mesh(scene, 1, glm::dmat4(0.0));
  scene.instances.back().to_world[3] = glm::dvec4(0, 0, 0, 1);
  finish_scene(scene);
  const LightSampler lights(scene);
  EXPECT_TRUE(std::isfinite(lights.power()));
  const auto finite = [](const LightSample& sample) {
    return std::isfinite(sample.weight.r) && std::isfinite(sample.pdf) && std::isfinite(sample.to_light.x) &&
           sample.pdf >= 0.0 && sample.weight.r >= 0.0;
  };
  for (std::uint32_t i = 0; i < 3000; ++i) {
    Sampler sampler(17, i);
    const glm::dvec3 position = i % 3 == 0 ? glm::dvec3(0.0) : i % 3 == 1 ? scene.bounds.high : glm::dvec3(1e200);
    const glm::dvec3 normal = i % 2 == 0 ? kUp : glm::dvec3(0.0);
    const double u = sampler.one();
    if (const auto sample = lights.sample_any(position, normal, View{}, u, sampler.two())) {
      EXPECT_TRUE(finite(*sample));
    }
    if (const auto sample = lights.sample(position, normal, View{}, u, sampler.two())) {
      EXPECT_TRUE(finite(*sample));
    }
    for (std::size_t light = 0; light < lights.enumerated(); ++light) {
      EXPECT_TRUE(finite(lights.sample_enumerated(light, position, View{}, sampler.two())));
    }
    const glm::dvec2 u_place = sampler.two();
    const auto photon = lights.emit(u, u_place, sampler.two());
    ASSERT_TRUE(photon.has_value());
    EXPECT_TRUE(std::isfinite(photon->flux.r) && std::isfinite(photon->direction.x) && std::isfinite(photon->origin.x));
  }
}

}  // namespace
}  // namespace hpr
