// How much light surfaces give back: furnaces, Fresnel's equations, total reflection.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "rt/materials/test_bsdf.h"
#include "rt/sampling/sampler.h"

namespace hpr {
namespace {

using test::bsdf_of;
using test::direction;

/// What one lobe sends to the viewer in a furnace of radiance 1, from 2^14 well-spread samples.
double albedo(const Bsdf& bsdf, Lobe lobe) {
  constexpr std::uint32_t kSamples = 1U << 14U;
  double sum = 0.0;
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    Sampler random(5, i);
    if (const auto sample = bsdf.sample(lobe, random.two())) sum += sample->weight.g;
  }
  return sum / kSamples;
}

double albedo(const Bsdf& bsdf) {
  double sum = 0.0;
  for (const Lobe lobe : kLobes) sum += albedo(bsdf, lobe);
  return sum;
}

TEST(BsdfEnergy, WhatLeavesAFurnaceIsWhatMitsubaMeasures) {
  // RAYS.md, section 4.6; the viewer looks straight at the surface.
  const auto measured = [](const MaterialPoint& material) { return albedo(bsdf_of(material, test::kUp)); };
  EXPECT_NEAR(measured(test::metal(0.1, 0.5)), 0.4998, 0.003 * 0.4998);
  EXPECT_NEAR(measured(test::metal(1.0, 0.5)), 0.154, 0.003 * 0.154 + 0.0005);
  EXPECT_NEAR(measured(test::dielectric(0.3, 0.5)), 0.519, 0.003 * 0.519);
  EXPECT_NEAR(measured(test::dielectric(1.0, 0.5)), 0.493, 0.003 * 0.493);
  EXPECT_NEAR(measured(test::metal(0.5, 0.5)), 0.459, 0.003 * 0.459);
}

TEST(BsdfEnergy, AWhiteMetalNeverReflectsMoreThanArrives) {
  for (const double roughness : {0.0, 1e-4, 1e-3, 0.03, 0.2, 0.5, 0.8, 1.0}) {
    for (const double polar : {0.0, 0.7, 1.3, 1.5, 1.57}) {
      const double reflected = albedo(bsdf_of(test::metal(roughness, 1.0), direction(polar, 0.3)));
      EXPECT_LE(reflected, 1.0 + 1e-9) << roughness << ' ' << polar;
      EXPECT_GT(reflected, 0.15) << roughness << ' ' << polar;
      if (roughness < 0.1 && polar < 1.4) {
        EXPECT_GT(reflected, 0.99) << roughness << ' ' << polar;
      }
    }
  }
}

/// Over all viewers, cosine-weighted: the share of a uniform hemisphere's light that leaves again.
TEST(BsdfEnergy, AnOpaqueDielectricOfAlbedo95ReflectsNoMoreThanArrives) {
  for (const double roughness : {0.1, 0.4, 0.7, 1.0}) {
    for (const double metallic : {0.0, 0.5}) {
      MaterialPoint material = test::dielectric(roughness, 0.95);
      material.metallic = metallic;
      constexpr int kViewers = 12;
      double sum = 0.0;
      for (int i = 0; i < kViewers; ++i) {
        sum += albedo(bsdf_of(material, direction(std::asin(std::sqrt((i + 0.5) / kViewers)), 0.3)));
      }
      EXPECT_LE(sum / kViewers, 1.0 + 1e-3) << roughness << ' ' << metallic;
    }
  }
}

TEST(BsdfEnergy, AnIndexOfOneLeavesLambertsLawAlone) {
  for (const double polar : {0.0, 0.8, 1.5, 1.57}) {
    const Bsdf white = bsdf_of(test::dielectric(0.0, 0.75, 1.0), direction(polar, 1.0));
    EXPECT_EQ(white.weight(Lobe::Reflection), glm::dvec3(0.0));
    EXPECT_NEAR(albedo(white), 0.75, 1e-12) << polar;
    EXPECT_NEAR(white.value(Lobe::Diffuse, direction(1.56, 3.0)).g, 0.75 / std::numbers::pi, 1e-12);
  }
}

TEST(BsdfEnergy, SmoothGlassPassesOnAllLight) {
  for (const double ior : {1.0, 1.0001, 1.5, 3.0}) {
    for (const bool inside : {false, true}) {
      for (const double polar : {0.0, 0.3, 0.9, 1.4, 1.57}) {
        for (const MaterialPoint& material : {test::glass(0.0, ior), test::sheet(0.0, ior)}) {
          const Bsdf flux = bsdf_of(material, direction(polar, 0.2), inside, Carried::Flux);
          EXPECT_NEAR(albedo(flux), 1.0, 1e-9) << ior << ' ' << inside << ' ' << polar << ' ' << material.solid;
        }
      }
    }
  }
}

TEST(BsdfEnergy, RadianceIsSqueezedByTheSquareOfTheIndex) {
  const glm::dvec3 viewer = direction(0.5, 0.2);
  for (const double roughness : {0.0, 0.3}) {
    const auto through = [&](bool inside, Carried carried) {
      return albedo(bsdf_of(test::glass(roughness, 1.5), viewer, inside, carried), Lobe::Transmission);
    };
    EXPECT_NEAR(through(false, Carried::Radiance), through(false, Carried::Flux) / 2.25, 1e-9);
    EXPECT_NEAR(through(true, Carried::Radiance), through(true, Carried::Flux) * 2.25, 1e-9);
  }
}

TEST(BsdfEnergy, RefractionFollowsSnellAndFresnel) {
  for (const double polar : {0.0, 0.3, 0.9, 1.4}) {
    const Bsdf glass = bsdf_of(test::glass(0.0, 1.5), direction(polar, 0.2), false, Carried::Flux);
    const auto refracted = glass.sample(Lobe::Transmission, {0.3, 0.8});
    ASSERT_TRUE(refracted);
    EXPECT_EQ(refracted->pdf, 0.0);
    const double sine = std::sin(polar) / 1.5;
    const glm::dvec3 expected = direction(std::numbers::pi - std::asin(sine), 0.2 + std::numbers::pi);
    EXPECT_LT(glm::distance(refracted->direction, expected), 1e-12) << polar;
    // Fresnel's equations in their trigonometric form (Born and Wolf, section 1.5.2).
    const double t = std::asin(sine);
    const double across = polar == 0.0 ? -0.2 : -std::sin(polar - t) / std::sin(polar + t);
    const double along = polar == 0.0 ? 0.2 : std::tan(polar - t) / std::tan(polar + t);
    const double reflected = 0.5 * (across * across + along * along);
    EXPECT_NEAR(glass.weight(Lobe::Reflection).r, reflected, 1e-12) << polar;
    EXPECT_NEAR(refracted->weight.r, 1.0 - reflected, 1e-12) << polar;
  }
}

TEST(BsdfEnergy, BeyondTheCriticalAngleAllIsReflected) {
  const double critical = std::asin(1.0 / 1.5);
  const Bsdf beyond = bsdf_of(test::glass(0.0), direction(critical + 1e-6, 0.0), true);
  EXPECT_EQ(beyond.weight(Lobe::Reflection), glm::dvec3(1.0));
  EXPECT_EQ(beyond.weight(Lobe::Transmission), glm::dvec3(0.0));
  EXPECT_FALSE(beyond.sample(Lobe::Transmission, {0.5, 0.5}));
  const Bsdf before = bsdf_of(test::glass(0.0), direction(critical - 1e-6, 0.0), true, Carried::Flux);
  EXPECT_TRUE(before.sample(Lobe::Transmission, {0.5, 0.5}));
  EXPECT_LT(before.weight(Lobe::Reflection).r, 1.0);
}

TEST(BsdfEnergy, RoughGlassLosesOnlyWhatItsFacetsHide) {
  for (const double ior : {1.0, 1.0001, 1.5, 3.0}) {
    for (const double roughness : {1e-4, 0.1, 0.3, 1.0}) {
      for (const bool inside : {false, true}) {
        for (const double polar : {0.0, 0.6, 1.2, 1.5}) {
          for (const MaterialPoint& material : {test::glass(roughness, ior), test::sheet(roughness, ior)}) {
            const Bsdf bsdf = bsdf_of(material, direction(polar, 0.2), inside, Carried::Flux);
            const double left = albedo(bsdf);
            // Fresnel's term is taken at the mean normal where the index hardly differs.
            EXPECT_LE(left, 1.0 + 2e-3) << ior << ' ' << roughness << ' ' << inside << ' ' << polar;
            if (roughness < 0.2 && polar < 1.3) {
              EXPECT_GT(left, 0.99) << ior << ' ' << roughness << ' ' << polar;
            }
            EXPECT_GT(left, 0.2) << ior << ' ' << roughness << ' ' << inside << ' ' << polar;
          }
        }
      }
    }
  }
}

TEST(BsdfEnergy, APaneAndASheetShowTheBaseColorOnce) {
  MaterialPoint material = test::sheet(0.0, 1.0);
  material.base_color = {0.25, 0.5, 1.0};
  const glm::dvec3 once = bsdf_of(material, direction(0.4, 0.0)).weight(Lobe::Transmission);
  EXPECT_EQ(once, material.base_color);
  material.solid = true;
  const glm::dvec3 in = bsdf_of(material, direction(0.4, 0.0)).weight(Lobe::Transmission);
  const glm::dvec3 out = bsdf_of(material, direction(0.4, 0.0), true).weight(Lobe::Transmission);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(in[c] * out[c], material.base_color[c], 1e-12);
}

TEST(BsdfEnergy, AnIndexOfZeroReflectsEverything) {
  for (const double transmission : {0.0, 1.0}) {
    MaterialPoint material = test::dielectric(0.0, 0.5, 0.0);
    material.transmission = transmission;
    const Bsdf mirror = bsdf_of(material, direction(0.7, 0.0));
    EXPECT_EQ(mirror.weight(Lobe::Reflection), glm::dvec3(1.0));
    EXPECT_EQ(mirror.weight(Lobe::Diffuse), glm::dvec3(0.0));
    EXPECT_EQ(mirror.weight(Lobe::Transmission), glm::dvec3(0.0));
  }
}

MaterialPoint half_glass(double roughness, double transmission, bool solid, double ior = 1.5) {
  MaterialPoint material = solid ? test::glass(roughness, ior) : test::sheet(roughness, ior);
  material.transmission = transmission;
  return material;
}

TEST(BsdfEnergy, ASurfaceThatTransmitsInPartNeverGivesBackMoreThanArrives) {
  const double critical = std::asin(1.0 / 1.5);
  for (const double roughness : {0.0, 0.1, 0.3, 0.6, 1.0}) {
    for (const double transmission : {0.05, 0.5, 0.95}) {
      for (const double polar : {0.0, critical - 0.02, critical + 1e-6, 0.9, 1.3, 1.5}) {
        for (const int side : {0, 1, 2}) {
          const Bsdf bsdf =
              bsdf_of(half_glass(roughness, transmission, side < 2), direction(polar, 0.2), side == 1, Carried::Flux);
          EXPECT_LE(albedo(bsdf), 1.0 + 2e-3) << roughness << ' ' << transmission << ' ' << polar << ' ' << side;
        }
      }
    }
  }
}

TEST(BsdfEnergy, FromOutsideASmoothSurfaceThatTransmitsInPartLosesNothing) {
  for (const double ior : {1.0, 1.005, 1.02, 1.33, 1.5, 2.4, 10.0}) {
    for (const double polar : {0.0, 0.8, 1.3, 1.55}) {
      for (const bool solid : {false, true}) {
        const double left =
            albedo(bsdf_of(half_glass(0.0, 0.5, solid, ior), direction(polar, 0.2), false, Carried::Flux));
        EXPECT_NEAR(left, 1.0, 2e-3) << ior << ' ' << polar << ' ' << solid;
      }
    }
  }
}

// A path that chooses a lobe by its weight is not to grow by it: where hardly any light enters, weight and light vanish
// together.
TEST(BsdfEnergy, WhatIsScatteredDiffuselyBelowASpecularLayerIsNearItsWeight) {
  const double critical = std::asin(1.0 / 1.5);
  for (const double polar : {0.0, critical - 0.1, critical - 1e-6, critical - 1e-12}) {
    const Bsdf inside = bsdf_of(half_glass(0.0, 0.5, true), direction(polar, 0.2), true);
    for (std::uint32_t i = 0; i < 256; ++i) {
      const auto sample = inside.sample(Lobe::Diffuse, Sampler(5, i).two());
      ASSERT_TRUE(sample) << polar;
      EXPECT_LE(sample->weight.g, 1.2 * inside.weight(Lobe::Diffuse).g) << polar;
    }
  }
  const Bsdf beyond = bsdf_of(half_glass(0.3, 0.5, true), direction(critical + 1e-6, 0.2), true);
  EXPECT_FALSE(beyond.present(Lobe::Diffuse));
  EXPECT_EQ(beyond.weight(Lobe::Diffuse), glm::dvec3(0.0));
  EXPECT_EQ(beyond.pdf(Lobe::Diffuse, test::kUp), 0.0);
  EXPECT_FALSE(beyond.sample(Lobe::Diffuse, {0.5, 0.5}));
}

TEST(BsdfEnergy, WeightsAreNearTheLobesShares) {
  for (const double roughness : {0.1, 0.4}) {
    for (const double polar : {0.2, 0.9}) {
      MaterialPoint material = test::glass(roughness);
      material.transmission = 0.6;
      material.metallic = 0.3;
      material.base_color = glm::dvec3(0.7);
      const Bsdf bsdf = bsdf_of(material, direction(polar, 0.0), false, Carried::Flux);
      for (const Lobe lobe : kLobes) {
        const double expected = albedo(bsdf, lobe);
        EXPECT_NEAR(bsdf.weight(lobe).g, expected, 0.15 * expected + 0.02) << static_cast<int>(lobe);
      }
    }
  }
}

}  // namespace
}  // namespace hpr
