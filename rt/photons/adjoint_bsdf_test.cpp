#include "rt/photons/adjoint_bsdf.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/trigonometric.hpp>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "rt/materials/test_bsdf.h"
#include "rt/sampling/sampling.h"
#include "rt/test_scene.h"

// Light that is carried from lamps against light that is looked for from the eye, where normals lean.
namespace hpr {
namespace {

struct Leaning {
  double degrees;  ///< the shading normal's, towards +x
  bool mapped;     ///< by a normal map, on top of a smooth normal that leans half as far towards -y
};

/// A place in the plane z = 0 with one material.
struct Place {
  Scene scene;
  std::optional<Surfaces> surfaces;
  WorldTriangle triangle;

  Place(const Material& material, const Leaning& leaning) {
    const std::uint32_t used = test::add_material(scene, material);
    const double angle = glm::radians(leaning.degrees);
    Mesh mesh = test::quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, used);
    mesh.normals.assign(
        4, leaning.mapped ? test::direction(0.5 * angle, glm::radians(-90.0)) : test::direction(angle, 0.0));
    if (leaning.mapped) {
      const auto byte = [](double value) { return static_cast<std::uint8_t>(std::lround(127.5 + 127.5 * value)); };
      Texture map;
      map.image = Image<Rgba8>({1, 1}, {byte(std::sin(angle)), 128, byte(std::cos(angle)), 255});
      scene.textures.push_back(std::move(map));
      scene.materials[used].normal_texture.texture = 0;
    }
    test::place_mesh(scene, test::add_mesh(scene, std::move(mesh)));
    finish_scene(scene);
    surfaces.emplace(scene, RaySpace(scene));
    surfaces->load(0, triangle);
  }

  [[nodiscard]] SurfacePoint from(const glm::dvec3& direction) const {
    const glm::dvec3 position(0.2, -0.3, 0.0);
    return surfaces->meet(triangle, position + direction, -direction);
  }
};

Material surface_of(float metallic, float roughness) {
  Material material;
  material.base_color = {0.8F, 0.6F, 0.4F, 1.0F};
  material.metallic = metallic;
  material.roughness = roughness;
  return material;
}

/// What lamps shine, by direction, and what an eye is worth: light and eye must agree on the sum, whatever these are.
std::array<double, 3> brightness_of(const glm::dvec3& direction) {
  return {1.0, direction.x > 0.3 ? 1.0 : 0.0, std::abs(direction.z) < 0.5 ? direction.y + 1.0 : 0.0};
}
std::array<double, 3> worth_of(const glm::dvec3& direction) {
  return {1.0, direction.y > 0.1 ? 1.0 : 0.0, std::abs(direction.z) < 0.4 ? 2.0 : 0.5 * std::abs(direction.x)};
}

using Sums = std::array<std::array<double, 3>, 3>;  ///< [lamp][eye]

/// Adds `amount`, in a direction chosen evenly on the sphere.
void add(Sums& sums, double amount, const glm::dvec3& lamp, const glm::dvec3& eye) {
  const auto brightness = brightness_of(lamp);
  const auto worth = worth_of(eye);
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) sums.at(i).at(j) += amount * brightness.at(i) * worth.at(j);
  }
}

constexpr std::uint32_t kSamples = 1U << 19U;

/// Eyes that look for light by the lobe.
Sums by_eyes(const Place& location, Lobe lobe) {
  Sums sums{};
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    Sampler sampler(7, i);
    const glm::dvec3 eye = warp::on_sphere(sampler.two());
    const SurfacePoint surface = location.from(eye);
    const Bsdf bsdf(evaluate_material(location.scene, surface), surface);
    const auto sample = bsdf.sample(lobe, sampler.two());
    if (sample) add(sums, sample->weight.r * std::abs(eye.z) / kSamples, sample->direction, eye);
  }
  return sums;
}

/// Light that looks for eyes.
Sums by_light(const Place& location, Lobe lobe) {
  Sums sums{};
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    Sampler sampler(8, i);
    const glm::dvec3 light = warp::on_sphere(sampler.two());
    const SurfacePoint surface = location.from(light);
    const MaterialPoint material = evaluate_material(location.scene, surface);
    const Bsdf bsdf(material, surface, Carried::Flux);
    const FluxArrival arrival{surface, material, bsdf, location.triangle};
    const AdjointBsdf scatters(location.scene, *location.surfaces, arrival);
    const auto sample = scatters.sample(lobe, sampler);
    EXPECT_TRUE(!sample || sample->weight.r == 0.0 || scatters.weight(lobe).r > 0.0);
    if (!sample) continue;
    EXPECT_TRUE(std::isfinite(sample->weight.r) && sample->weight.r >= 0.0);
    EXPECT_NEAR(glm::length(sample->direction), 1.0, 1e-9);
    // What refraction squeezes is radiance: flux counts as much of it as an eye sees.
    add(sums, sample->weight.r * std::abs(light.z) / kSamples, light, sample->direction);
  }
  return sums;
}

Material glass(float roughness, float thickness) {
  Material material = test::clear_glass(1.5F, thickness);
  material.roughness = roughness;
  return material;
}

/// What becomes of light that falls from everywhere on smooth glass, as wide as that, whose normals spread.
std::vector<glm::dvec3> sent_through_glass(double scale) {
  Scene scene;
  const std::uint32_t used = test::add_material(scene, glass(0.0F, 1.0F));
  Mesh mesh = test::quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, used);
  for (const glm::vec3& corner : mesh.positions) {
    mesh.normals.push_back(glm::normalize(glm::vec3(0.4F * corner.x, 0.3F * corner.y, 1.0F)));
  }
  test::place_mesh(scene, test::add_mesh(scene, std::move(mesh)), glm::scale(glm::dmat4(1.0), glm::dvec3(scale)));
  finish_scene(scene);
  const Surfaces surfaces(scene, RaySpace(scene));
  WorldTriangle triangle;
  surfaces.load(0, triangle);
  std::vector<glm::dvec3> sent;
  for (std::uint32_t i = 0; i < 4096; ++i) {
    Sampler sampler(9, i);
    const glm::dvec3 light = warp::on_sphere(sampler.two());
    const glm::dvec2 u = sampler.two();
    const SurfacePoint surface =
        surfaces.meet(triangle, scale * (glm::dvec3(0.9 * u.x, -0.9 * u.y, 0.0) + light), -light);
    const MaterialPoint material = evaluate_material(scene, surface);
    const Bsdf bsdf(material, surface, Carried::Flux);
    sent.push_back(AdjointBsdf(scene, surfaces, {surface, material, bsdf, triangle}).weight(Lobe::Transmission));
  }
  return sent;
}

// Every length is one of the scene's: none is a metre.
TEST(AdjointBsdfScale, APowerOfTwoChangesNoBit) {
  const std::vector<glm::dvec3> expected = sent_through_glass(1.0);
  EXPECT_GT(std::ranges::count_if(expected, [](const glm::dvec3& weight) { return weight.r > 0.0; }), 1000);
  for (const double scale : {0x1p-20, 0x1p20}) EXPECT_EQ(sent_through_glass(scale), expected) << scale;
}

class AdjointBsdfTest : public testing::TestWithParam<Leaning> {};

TEST_P(AdjointBsdfTest, SendsOnWhatEyesSee) {
  const std::array cases{std::tuple("matte", Lobe::Diffuse, surface_of(0.0F, 0.6F)),
                         std::tuple("rough metal", Lobe::Reflection, surface_of(1.0F, 0.5F)),
                         std::tuple("rough varnish", Lobe::Reflection, surface_of(0.0F, 0.9F)),
                         std::tuple("mirror", Lobe::Reflection, surface_of(1.0F, 0.0F)),
                         std::tuple("frosted sheet", Lobe::Transmission, glass(0.5F, 0.0F)),
                         std::tuple("clear sheet", Lobe::Transmission, glass(0.0F, 0.0F)),
                         std::tuple("frosted solid", Lobe::Transmission, glass(0.4F, 1.0F)),
                         std::tuple("clear solid", Lobe::Transmission, glass(0.0F, 1.0F))};
  for (const auto& [name, lobe, material] : cases) {
    const Place location(material, GetParam());
    const Sums seen = by_eyes(location, lobe);
    const Sums sent = by_light(location, lobe);
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) {
        EXPECT_NEAR(sent.at(i).at(j), seen.at(i).at(j), 0.002 + 0.015 * seen.at(i).at(j))
            << name << ", lamp " << i << ", eye " << j;
      }
    }
  }
}

std::string name_of(const testing::TestParamInfo<Leaning>& info) {
  return std::to_string(std::lround(info.param.degrees)) + (info.param.mapped ? "DegreesMapped" : "DegreesSmooth");
}

INSTANTIATE_TEST_SUITE_P(Normals, AdjointBsdfTest,
                         testing::Values(Leaning{0, false}, Leaning{10, false}, Leaning{40, false}, Leaning{70, false},
                                         Leaning{25, true}, Leaning{58, true}),
                         name_of);

}  // namespace
}  // namespace hpr
