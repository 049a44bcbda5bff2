#include "rt/flux_scatter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

#include "rt/bsdf_test_tools.h"

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
  SurfacePoint surface;

  Place(const Material& material, const Leaning& leaning) {
    scene.materials.push_back(material);
    surface.geometric_normal = test::kUp;
    const double angle = glm::radians(leaning.degrees);
    if (!leaning.mapped) {
      surface.shading_normal = test::direction(angle, 0.0);
      return;
    }
    surface.shading_normal = test::direction(0.5 * angle, glm::radians(-90.0));
    surface.tangent = {1, 0, 0};
    surface.bitangent = glm::cross(surface.shading_normal, surface.tangent);
    const auto byte = [](double value) { return static_cast<std::uint8_t>(std::lround(127.5 + 127.5 * value)); };
    Texture map;
    map.image = Image<Rgba8>({1, 1});
    map.image.at(0, 0) = {byte(std::sin(angle)), 128, byte(std::cos(angle)), 255};
    scene.textures.push_back(std::move(map));
    scene.materials[0].normal_texture.texture = 0;
  }

  [[nodiscard]] SurfacePoint from(const glm::dvec3& direction) const {
    SurfacePoint point = surface;
    point.to_viewer = direction;
    return point;
  }

  /// Of light of one flux on the true surface, what an eye in `direction` sees of it times its own cosine: 1/sr.
  [[nodiscard]] glm::dvec3 seen(Lobe lobe, const glm::dvec3& light, const glm::dvec3& direction) const {
    const SurfacePoint point = from(direction);
    const MaterialPoint material = evaluate_material(scene, point);
    const Bsdf bsdf(material, point);
    return bsdf.value(lobe, light) * (std::abs(glm::dot(material.normal, light)) / light.z * direction.z);
  }
};

Material surface_of(float metallic, float roughness) {
  Material material;
  material.base_color = {0.8F, 0.6F, 0.4F, 1.0F};
  material.metallic = metallic;
  material.roughness = roughness;
  return material;
}

/// Evenly over the sky of z > 0, in the middle of cells of equal solid angle.
template <typename Function>
glm::dvec3 over_the_sky(Function&& function) {
  constexpr int kSide = 400;
  glm::dvec3 sum(0.0);
  for (int i = 0; i < kSide; ++i) {
    for (int j = 0; j < kSide; ++j) {
      const double polar = std::acos((i + 0.5) / kSide);
      sum += function(test::direction(polar, 2.0 * std::numbers::pi * (j + 0.5) / kSide));
    }
  }
  return sum * (2.0 * std::numbers::pi / (kSide * kSide));
}

/// Of all that goes out, and of what goes to one side of the lean and to the other, almost along the surface included.
constexpr int kParts = 4;
int part_of(const glm::dvec3& direction) {
  return (direction.x > 0.0 ? 1 : 0) + (direction.z < 0.4 ? 2 : 0);
}

class FluxScatter : public testing::TestWithParam<Leaning> {};

TEST_P(FluxScatter, SendsOnWhatEyesSee) {
  for (const auto& [lobe, material] :
       {std::pair{Lobe::Diffuse, surface_of(0.0F, 0.6F)}, std::pair{Lobe::Reflection, surface_of(1.0F, 0.5F)},
        std::pair{Lobe::Reflection, surface_of(0.0F, 0.9F)}}) {
    const Place place(material, GetParam());
    for (const glm::dvec3& light : {test::direction(0.3, 2.0), test::direction(1.1, 0.2), test::direction(1.1, 3.0),
                                    test::direction(1.35, -1.4)}) {
      std::array<glm::dvec3, kParts> expected{};
      std::array<glm::dvec3, kParts> sent{};
      for (int part = 0; part < kParts; ++part) {
        const auto index = static_cast<std::size_t>(part);
        expected[index] = over_the_sky([&](const glm::dvec3& direction) {
          return part_of(direction) == part ? place.seen(lobe, light, direction) : glm::dvec3(0.0);
        });
      }
      const SurfacePoint surface = place.from(light);
      const MaterialPoint point = evaluate_material(place.scene, surface);
      const Bsdf bsdf(point, surface, Carried::Flux);
      constexpr std::uint32_t kSamples = 1U << 16U;
      for (std::uint32_t i = 0; i < kSamples; ++i) {
        Sampler sampler(7, i);
        const auto sample = sample_flux(place.scene, {surface, point, bsdf}, lobe, sampler);
        if (!sample) continue;
        ASSERT_TRUE(std::isfinite(sample->weight.r) && sample->weight.r >= 0.0);
        ASSERT_NEAR(glm::length(sample->direction), 1.0, 1e-12);
        sent[static_cast<std::size_t>(part_of(sample->direction))] += sample->weight / double{kSamples};
      }
      for (std::size_t part = 0; part < kParts; ++part) {
        EXPECT_NEAR(sent[part].r, expected[part].r, 0.004 + 0.01 * expected[part].r)
            << "part " << part << " of lobe " << static_cast<int>(lobe) << ", light at " << light.x << ' ' << light.y;
      }
    }
  }
}

std::string name_of(const testing::TestParamInfo<Leaning>& info) {
  return std::to_string(std::lround(info.param.degrees)) + (info.param.mapped ? "DegreesMapped" : "DegreesSmooth");
}

INSTANTIATE_TEST_SUITE_P(Normals, FluxScatter,
                         testing::Values(Leaning{0, false}, Leaning{10, false}, Leaning{40, false}, Leaning{70, false},
                                         Leaning{25, true}, Leaning{58, true}),
                         name_of);

}  // namespace
}  // namespace hpr
