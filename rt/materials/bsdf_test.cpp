#include "rt/materials/bsdf.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "rt/materials/test_bsdf.h"

namespace hpr {
namespace {

using test::bsdf_of;
using test::direction;
using test::kUp;

/// Numbers in [0, 1), and often the ends of what materials may have.
class Odd {
 public:
  double operator()() {
    constexpr std::array<double, 6> kEnds{0.0, 1.0, 1e-4, 1e-3, 0.5, 1.0 - 1e-12};
    return random_() % 3 == 0 ? kEnds[random_() % kEnds.size()] : uniform_(random_);
  }
  glm::dvec3 unit() {
    const glm::dvec3 axis[] = {{0, 0, 1}, {0, 0, -1}, {1, 0, 0}, {0, -1, 0}, {1, 0, 1e-9}, {-1, 0, 1e-300}};
    if (random_() % 4 == 0) return glm::normalize(axis[random_() % 6]);
    return direction(std::acos(1.0 - 2.0 * uniform_(random_)), 2.0 * std::numbers::pi * uniform_(random_));
  }
  bool coin() { return random_() % 2 == 0; }
  MaterialPoint material() {
    MaterialPoint m;
    m.base_color = {(*this)(), (*this)(), (*this)()};
    m.metallic = (*this)();
    m.roughness = (*this)();
    m.transmission = (*this)();
    constexpr std::array<double, 8> kIndices{0.0, 1.0, 1.0 + 1e-15, 1.0001, 1.33, 1.5, 3.0, 1000.0};
    m.ior = kIndices[random_() % kIndices.size()];
    m.solid = coin();
    m.unlit = random_() % 16 == 0;
    return m;
  }

 private:
  std::mt19937 random_{11};
  std::uniform_real_distribution<double> uniform_{0.0, 1.0};
};

bool sound(const glm::dvec3& v) {
  return std::isfinite(v.r) && std::isfinite(v.g) && std::isfinite(v.b) && v.r >= 0.0 && v.g >= 0.0 && v.b >= 0.0;
}

TEST(Bsdf, IsNeverNegativeInfiniteOrNaN) {
  Odd odd;
  int sampled = 0;
  for (int i = 0; i < 100'000; ++i) {
    SurfacePoint surface = test::seen_from(odd.unit(), odd.coin());
    surface.geometric_normal = odd.coin() ? odd.unit() : glm::dvec3(0.0, 0.0, odd.coin() ? 1.0 : 0.0);
    MaterialPoint material = odd.material();
    material.normal = odd.coin() ? odd.unit() : kUp;
    const Bsdf bsdf(material, surface, odd.coin() ? Carried::Radiance : Carried::Flux);
    for (const Lobe lobe : kLobes) {
      const glm::dvec3 light = odd.coin() ? odd.unit() : -surface.to_viewer;
      ASSERT_TRUE(sound(bsdf.value(lobe, light))) << i;
      ASSERT_TRUE(std::isfinite(bsdf.pdf(lobe, light)) && bsdf.pdf(lobe, light) >= 0.0) << i;
      ASSERT_TRUE(sound(bsdf.weight(lobe))) << i;
      const glm::dvec3 both = bsdf.value(Lobe::Diffuse, light) + bsdf.value(Lobe::Reflection, light);
      ASSERT_LE(glm::distance(bsdf.reflected(light), both), 1e-15 * glm::length(both)) << i;
      const auto sample = bsdf.sample(lobe, {std::min(odd(), 1.0 - 0x1p-32), std::min(odd(), 1.0 - 0x1p-32)});
      if (!sample) continue;
      ++sampled;
      ASSERT_TRUE(sound(sample->weight)) << i;
      ASSERT_NEAR(glm::length(sample->direction), 1.0, 1e-9) << i;
      ASSERT_TRUE(std::isfinite(sample->pdf) && sample->pdf >= 0.0) << i;
      ASSERT_EQ(sample->pdf == 0.0, bsdf.is_delta(lobe)) << i;
      ASSERT_NE(bsdf.weight(lobe), glm::dvec3(0.0)) << "a lobe without weight gave a sample: " << i;
    }
  }
  EXPECT_GT(sampled, 20'000);
}

TEST(Bsdf, ScattersAsItsLobesDoOneByOne) {
  Odd odd;
  std::array<int, kLobes.size()> seen{};
  for (int i = 0; i < 20'000; ++i) {
    SurfacePoint surface = test::seen_from(odd.unit(), odd.coin());
    if (odd.coin()) surface.geometric_normal = odd.unit();
    const Bsdf bsdf(odd.material(), surface, odd.coin() ? Carried::Radiance : Carried::Flux);
    const glm::dvec3 to_light = odd.unit();
    const Scattering all = bsdf.scattering(to_light);
    for (std::size_t lobe = 0; lobe < kLobes.size(); ++lobe) {
      ASSERT_EQ(all.value[lobe], bsdf.value(kLobes[lobe], to_light)) << i << ' ' << lobe;
      ASSERT_EQ(all.pdf[lobe], bsdf.pdf(kLobes[lobe], to_light)) << i << ' ' << lobe;
      seen[lobe] += all.pdf[lobe] > 0.0;
    }
  }
  for (const Lobe lobe : Bsdf().lobes()) EXPECT_GT(seen[static_cast<std::size_t>(lobe)], 500);
}

TEST(Bsdf, SurvivesDirectionsThatAreNone) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  for (const glm::dvec3& d : {glm::dvec3(nan), glm::dvec3(0.0), glm::dvec3(0.0, nan, 1.0), glm::dvec3(infinity)}) {
    for (const MaterialPoint& material : {test::metal(0.3, 0.5), test::glass(0.3), test::dielectric(0.0, 0.5)}) {
      for (const Lobe lobe : kLobes) {
        EXPECT_FALSE(std::isnan(bsdf_of(material, kUp).value(lobe, d).g));
        EXPECT_FALSE(std::isnan(bsdf_of(material, kUp).pdf(lobe, d)));
        EXPECT_FALSE(bsdf_of(material, d).sample(lobe, {0.5, 0.5}) && !std::isfinite(d.z));
      }
    }
  }
}

TEST(Bsdf, ReflectsTheSameWithLightAndViewerSwapped) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (int i = 0; i < 5000; ++i) {
    MaterialPoint material = test::dielectric(uniform(random), 1.0);
    material.base_color = {uniform(random), uniform(random), uniform(random)};
    material.metallic = uniform(random);
    material.transmission = i % 2 == 0 ? 0.0 : uniform(random);
    material.solid = i % 4 < 2;
    const glm::dvec3 a = direction(1.57 * uniform(random), 6.28 * uniform(random));
    const glm::dvec3 b = direction(1.57 * uniform(random), 6.28 * uniform(random));
    for (const Lobe lobe : {Lobe::Diffuse, Lobe::Reflection}) {
      const glm::dvec3 there = bsdf_of(material, a, i % 8 < 4).value(lobe, b);
      const glm::dvec3 back = bsdf_of(material, b, i % 8 < 4).value(lobe, a);
      for (int c = 0; c < 3; ++c) ASSERT_NEAR(there[c], back[c], 1e-12 * (1.0 + there[c])) << i;
    }
  }
}

// Veach 1997, section 5.2: f / n^2 is symmetric, n being the index on the side that f leads to. Carrying flux is
// carrying radiance the other way.
TEST(Bsdf, TransmitsTheSameWithLightAndViewerSwappedButForTheIndex) {
  std::mt19937 random(8);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  int compared = 0;
  for (int i = 0; i < 5000; ++i) {
    MaterialPoint material = test::glass(0.1 + 0.9 * uniform(random), 1.0 + uniform(random));
    material.solid = i % 3 != 0;
    const double index = material.solid ? material.ior : 1.0;
    const glm::dvec3 above = direction(1.57 * uniform(random), 6.28 * uniform(random));
    const glm::dvec3 below = -direction(1.57 * uniform(random), 6.28 * uniform(random));
    const SurfacePoint outside = test::seen_from(above);
    SurfacePoint within = test::seen_from(below, true);
    within.geometric_normal = within.shading_normal = -kUp;
    MaterialPoint turned = material;
    turned.normal = -kUp;
    const double seen = Bsdf(material, outside).value(Lobe::Transmission, below).g;
    const double back = Bsdf(turned, within).value(Lobe::Transmission, above).g;
    ASSERT_NEAR(seen, back / (index * index), 1e-9 * (1.0 + seen)) << i;
    const double carried = Bsdf(turned, within, Carried::Flux).value(Lobe::Transmission, above).g;
    ASSERT_NEAR(seen, carried, 1e-9 * (1.0 + seen)) << i;
    compared += seen > 1e-3 ? 1 : 0;
  }
  EXPECT_GT(compared, 1000);
}

TEST(Bsdf, HasNoMirrorHighlightWhenPerfectlySmoothAndAFiniteOneWhenNearlySo) {
  EXPECT_EQ(bsdf_of(test::metal(0.0, 0.5), kUp).value(Lobe::Reflection, kUp), glm::dvec3(0.0));
  for (const double roughness : {1e-3, 1e-2, 0.1, 1.0}) {
    const double peak = bsdf_of(test::metal(roughness, 0.5), kUp).value(Lobe::Reflection, kUp).r;
    // D = 1 / (pi alpha^2), G = 1, 4 n.l n.v = 4.
    EXPECT_NEAR(peak / (0.5 / (4.0 * std::numbers::pi * std::pow(roughness, 4.0))), 1.0, 1e-9) << roughness;
  }
}

TEST(Bsdf, MirrorsAtTheShadingNormalButNeverIntoTheSurface) {
  MaterialPoint mirror = test::metal(0.0, 1.0);
  mirror.normal = direction(0.2, 0.0);
  const auto plain = Bsdf(mirror, test::seen_from(direction(0.5, 0.0))).sample(Lobe::Reflection, {0.0, 0.0});
  ASSERT_TRUE(plain);
  EXPECT_LT(glm::distance(plain->direction, direction(0.1, std::numbers::pi)), 1e-12);
  mirror.normal = direction(0.7, std::numbers::pi);
  const auto bent = Bsdf(mirror, test::seen_from(direction(0.5, 0.0))).sample(Lobe::Reflection, {0.0, 0.0});
  ASSERT_TRUE(bent);
  EXPECT_GT(bent->direction.z, 0.0);
  EXPECT_NEAR(glm::length(bent->direction), 1.0, 1e-12);
}

TEST(Bsdf, TakesFromTheBaseWhatIsLetThrough) {
  const auto value = [](double transmission) {
    MaterialPoint material = test::dielectric(0.4, 0.5);
    material.transmission = transmission;
    return bsdf_of(material, direction(0.7, 2.0)).value(Lobe::Diffuse, direction(0.4, 1.0)).g;
  };
  EXPECT_EQ(value(1.0), 0.0);
  EXPECT_NEAR(value(0.25), 1.5 * value(0.5), 1e-12);
  EXPECT_NEAR(value(0.5) / 0.5, value(0.0), 0.06 * value(0.0)) << "by Fresnel's equations as by Schlick's term";
}

TEST(Bsdf, ScattersToTheSideBothNormalsAgreeOn) {
  MaterialPoint material = test::dielectric(0.5, 0.5);
  material.transmission = 0.5;
  material.normal = direction(0.6, 0.0);
  const Bsdf bsdf(material, test::seen_from(direction(0.3, 0.0)));
  const glm::dvec3 above_one = direction(1.3, std::numbers::pi);  // above the surface, below the shading plane
  const glm::dvec3 above_other = direction(1.9, 0.0);
  const glm::dvec3 above_both = direction(0.2, 0.0);
  for (const Lobe lobe : bsdf.lobes()) {
    EXPECT_EQ(bsdf.value(lobe, above_one), glm::dvec3(0.0));
    EXPECT_EQ(bsdf.value(lobe, above_other), glm::dvec3(0.0));
    EXPECT_EQ(bsdf.pdf(lobe, above_one), 0.0);
    EXPECT_EQ(bsdf.value(lobe, above_both).g > 0.0, lobe != Lobe::Transmission);
    EXPECT_EQ(bsdf.value(lobe, -above_both).g > 0.0, lobe == Lobe::Transmission);
  }
}

TEST(Bsdf, WeighsNothingExactlyWhereALobeIsAbsent) {
  const auto present = [](const MaterialPoint& material, Lobe lobe) {
    return bsdf_of(material, direction(1.0, 0.0)).weight(lobe) != glm::dvec3(0.0);
  };
  const MaterialPoint plastic = test::dielectric(0.4, 0.5);
  EXPECT_TRUE(present(plastic, Lobe::Diffuse) && present(plastic, Lobe::Reflection));
  EXPECT_FALSE(present(plastic, Lobe::Transmission));
  EXPECT_FALSE(present(test::dielectric(0.4, 0.0), Lobe::Diffuse));
  EXPECT_FALSE(present(test::metal(0.4, 0.5), Lobe::Diffuse) || present(test::metal(0.4, 0.5), Lobe::Transmission));
  EXPECT_TRUE(present(test::metal(0.4, 0.0), Lobe::Reflection)) << "even black metal, towards grazing light";
  EXPECT_FALSE(present(test::glass(0.0), Lobe::Diffuse));
  EXPECT_TRUE(present(test::glass(0.0), Lobe::Transmission) && present(test::glass(0.4), Lobe::Transmission));
  EXPECT_FALSE(present(test::glass(0.4, 1.0), Lobe::Reflection));
  // Rough glass lets light through some facets even where the mean one reflects all.
  EXPECT_NE(bsdf_of(test::glass(0.5), direction(0.8, 0.0), true).weight(Lobe::Transmission), glm::dvec3(0.0));
  MaterialPoint unlit = plastic;
  unlit.unlit = true;
  for (const Lobe lobe : kLobes) EXPECT_FALSE(present(unlit, lobe));
}

TEST(Bsdf, IsFiniteAtGrazingAngles) {
  for (const double roughness : {0.0, 1e-3, 0.5, 1.0}) {
    EXPECT_EQ(bsdf_of(test::metal(roughness, 0.5), kUp).value(Lobe::Reflection, -kUp), glm::dvec3(0.0));
    EXPECT_EQ(bsdf_of(test::metal(roughness, 0.5), direction(1.6, 0.0)).value(Lobe::Reflection, kUp), glm::dvec3(0.0));
    const double grazing = std::numbers::pi / 2.0 - 2e-9;
    const glm::dvec3 value =
        bsdf_of(test::metal(roughness, 0.5), direction(grazing, 3.0)).value(Lobe::Reflection, direction(grazing, 0.0));
    EXPECT_TRUE(sound(value)) << roughness;
  }
}

}  // namespace
}  // namespace hpr
