#include "rt/photons/photon_query.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <random>
#include <vector>

#include "rt/materials/test_bsdf.h"
#include "rt/photons/photon_map.h"
#include "rt/ray_settings.h"

namespace hpr {
namespace {

constexpr std::size_t kPhotons = 5000;

/// Surfaces of all kinds, and photons that fall on them from everywhere.
class Falling {
 public:
  explicit Falling(std::uint64_t seed) : random_(seed) {}

  double one() { return std::uniform_real_distribution<double>(0.0, 1.0)(random_); }

  glm::dvec3 unit() {
    std::normal_distribution<double> normal;
    return glm::normalize(glm::dvec3(normal(random_), normal(random_), normal(random_)));
  }

  MaterialPoint material() {
    MaterialPoint material;
    material.base_color = {one(), one(), one()};
    material.metallic = std::array{0.0, 1.0, one()}.at(random_() % 3);
    material.roughness = std::max(one(), 0.05);
    material.transmission = random_() % 3 == 0 ? 0.5 * one() : 0.0;
    material.ior = std::array{1.0, 0.0, 1.5, 1.0 + one()}.at(random_() % 4);
    material.solid = random_() % 2 == 0;
    return material;
  }

  /// All kPhotons of them in a random order, and weights, as far as `count`.
  FoundPhotons find(std::size_t count) {
    FoundPhotons found;
    found.count = count;
    found.index.resize(count + kReadBeyond);
    found.weight.resize(count + kReadBeyond);
    for (std::size_t i = 0; i < count; ++i) {
      found.index[i] = static_cast<std::uint32_t>(random_() % kPhotons);
      found.weight[i] = static_cast<float>(one());
    }
    return found;
  }

  std::vector<PhotonLight> photons() {
    std::vector<PhotonLight> lights(kPhotons);
    for (PhotonLight& light : lights) {
      light.direction = pack_direction(unit());
      for (float& flux : light.flux) flux = static_cast<float>(one());
    }
    return lights;
  }

  bool coin() { return random_() % 2 == 0; }

 private:
  std::mt19937_64 random_;
};

TEST(PhotonReflection, IsTheSumOfWhatTheBsdfMakesOfEveryPhoton) {
  Falling falling(3);
  const std::vector<PhotonLight> lights = falling.photons();
  int lit = 0;
  for (int i = 0; i < 20'000; ++i) {
    MaterialPoint material = falling.material();
    SurfacePoint surface = test::seen_from(test::direction(falling.one() * 1.5, 6.3 * falling.one()), falling.coin());
    const bool leans = falling.coin();
    if (leans) surface.geometric_normal = glm::normalize(test::kUp + 0.3 * falling.unit());
    const Bsdf bsdf(material, surface);
    const bool diffuse = falling.coin();
    const bool specular = !diffuse || falling.coin();
    FoundPhotons found = falling.find(i % 3 == 0 ? 1 : static_cast<std::size_t>(i) % 41);
    glm::dvec3 expected(0.0);
    double sum_of_sizes = 0.0;
    for (std::size_t k = 0; k < found.count; ++k) {
      const PhotonLight& light = lights[found.index[k]];
      const glm::dvec3 from = unpack_direction(light.direction);
      const glm::dvec3 flux(light.flux[0], light.flux[1], light.flux[2]);
      double falls = 1.0;
      if (leans) {
        const double on_surface = std::abs(glm::dot(from, surface.geometric_normal));
        falls = std::abs(from.z) / std::max(on_surface, 1e-3);
        // Which side such a photon is on, single precision may see otherwise.
        if (on_surface < 1e-5) found.weight[k] = 0.0F;
      }
      if (std::abs(from.z) < 1e-5) found.weight[k] = 0.0F;
      expected += (falls * found.weight[k]) * flux * bsdf.reflected(from, diffuse, specular);
      sum_of_sizes = expected.x + expected.y + expected.z;
    }
    const glm::dvec3 sum = reflect_photons(bsdf.reflection_terms(diffuse, specular), leans, lights.data(), found);
    ASSERT_LE(glm::distance(sum, expected), 2e-4 * sum_of_sizes) << i << ", " << found.count << " photons";
    lit += sum_of_sizes > 0.0 ? 1 : 0;
  }
  EXPECT_GT(lit, 10'000);
}

TEST(PhotonReflection, HasTheSameBitsWithAnyInstructions) {
  Falling falling(5);
  const std::vector<PhotonLight> lights = falling.photons();
  for (int i = 0; i < 300; ++i) {
    const MaterialPoint material = falling.material();
    const Bsdf bsdf(material, test::seen_from(test::direction(falling.one(), 6.3 * falling.one())));
    const ReflectionTerms terms = bsdf.reflection_terms(true, true);
    FoundPhotons found = falling.find(static_cast<std::size_t>(i));
    const glm::dvec3 widest = reflect_photons(terms, i % 2 == 0, lights.data(), found);
    for (const auto target : hwy::SupportedAndGeneratedTargets()) {
      hwy::SetSupportedTargetsForTest(target);
      EXPECT_EQ(reflect_photons(terms, i % 2 == 0, lights.data(), found), widest) << hwy::TargetName(target);
    }
    hwy::SetSupportedTargetsForTest(0);
  }
}

TEST(PhotonReflection, IsNoneWithoutPhotonsAndOnWhatScattersNothing) {
  Falling falling(7);
  const std::vector<PhotonLight> lights = falling.photons();
  FoundPhotons none;
  const Bsdf metal = test::bsdf_of(test::metal(0.5, 0.9), test::kUp);
  EXPECT_EQ(reflect_photons(metal.reflection_terms(true, true), false, lights.data(), none), glm::dvec3(0.0));
  MaterialPoint unlit = test::dielectric(0.5, 0.9);
  unlit.unlit = true;
  FoundPhotons some = falling.find(20);
  EXPECT_EQ(reflect_photons(test::bsdf_of(unlit, test::kUp).reflection_terms(true, true), false, lights.data(), some),
            glm::dvec3(0.0));
}

}  // namespace
}  // namespace hpr
