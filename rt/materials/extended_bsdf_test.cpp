// Surfaces with material extensions: what they give back, both ways round, and what the extensions say of single
// values.
#include "rt/materials/extended_bsdf.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "rt/materials/sheen.h"
#include "rt/materials/test_bsdf.h"
#include "rt/materials/thin_film.h"
#include "rt/sampling/sampler.h"

namespace hpr {
namespace {

using test::bsdf_of;
using test::direction;
using test::extended;
using test::kUp;

double albedo(const Bsdf& bsdf, Lobe lobe) {
  constexpr std::uint32_t kSamples = 1U << 12U;
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

/// Each extension alone, and all that go together.
std::vector<std::pair<std::string, ExtensionPoint>> each_extension() {
  std::vector<std::pair<std::string, ExtensionPoint>> all;
  const auto add = [&](const char* name, const std::function<void(ExtensionPoint&)>& set) {
    set(all.emplace_back(name, ExtensionPoint{}).second);
  };
  add("specular", [](ExtensionPoint& e) { e.specular = 0.5; });
  add("no specular", [](ExtensionPoint& e) { e.specular = 0.0; });
  add("specular color", [](ExtensionPoint& e) { e.specular_color = {0.5, 4.0, 1.0}; });
  add("smooth coat", [](ExtensionPoint& e) { e.clearcoat = 1.0; });
  add("rough coat", [](ExtensionPoint& e) {
    e.clearcoat = 0.8;
    e.clearcoat_roughness = 0.4;
    e.clearcoat_normal = direction(0.3, 2.0);
  });
  add("sheen", [](ExtensionPoint& e) {
    e.sheen_color = {1.0, 0.8, 0.2};
    e.sheen_roughness = 0.5;
  });
  add("rough sheen", [](ExtensionPoint& e) {
    e.sheen_color = glm::dvec3(1.0);
    e.sheen_roughness = 1.0;
  });
  add("anisotropy", [](ExtensionPoint& e) {
    e.anisotropy = 0.7;
    e.anisotropy_direction = {0.6, 0.8, 0.0};
  });
  add("film", [](ExtensionPoint& e) {
    e.iridescence = 1.0;
    e.iridescence_nm = 400.0;
  });
  add("half a film", [](ExtensionPoint& e) {
    e.iridescence = 0.5;
    e.iridescence_nm = 250.0;
    e.iridescence_ior = 1.8;
  });
  add("diffuse transmission", [](ExtensionPoint& e) {
    e.diffuse_transmission = 0.6;
    e.diffuse_transmission_color = {0.9, 1.0, 0.7};
  });
  add("all", [](ExtensionPoint& e) {
    e = {0.7,
         {1.2, 0.9, 0.8},
         0.5,
         0.2,
         direction(0.2, 1.0),
         {0.4, 0.5, 0.6},
         0.4,
         0.5,
         {1.0, 0.0, 0.0},
         0.3,
         1.4,
         300.0,
         0.4,
         {0.6, 0.9, 0.5}};
  });
  return all;
}

TEST(ExtendedBsdf, ThatAreNoneChangeNothing) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (int i = 0; i < 3000; ++i) {
    MaterialPoint material =
        test::dielectric(i % 5 == 0 ? 0.0 : uniform(random), 0.8, i % 7 == 0 ? 1.0 : 1.2 + uniform(random));
    material.base_color = {uniform(random), uniform(random), uniform(random)};
    material.metallic = i % 3 == 0 ? uniform(random) : 0.0;
    material.transmission = i % 2 == 0 ? 0.0 : uniform(random);
    material.solid = i % 4 < 2;
    const bool inside = i % 8 < 4;
    const glm::dvec3 viewer = direction(1.5 * uniform(random), 6.28 * uniform(random));
    const glm::dvec3 light = direction(3.14 * uniform(random), 6.28 * uniform(random));
    const Bsdf plain = bsdf_of(material, viewer, inside);
    const Bsdf neutral = bsdf_of(extended(material, {}), viewer, inside);
    for (const Lobe lobe : kLobes) {
      const glm::dvec3 expected = plain.value(lobe, light);
      const glm::dvec3 value = neutral.value(lobe, light);
      for (int c = 0; c < 3; ++c) {
        ASSERT_NEAR(value[c], expected[c], 1e-9 * (1.0 + expected[c])) << i << ' ' << static_cast<int>(lobe);
        // Without a step of the index there is nothing to choose.
        if (material.ior == 1.0) continue;
        ASSERT_NEAR(neutral.weight(lobe)[c], plain.weight(lobe)[c], 1e-3) << i << ' ' << static_cast<int>(lobe);
      }
      ASSERT_NEAR(neutral.pdf(lobe, light), plain.pdf(lobe, light), 1e-9 * (1.0 + plain.pdf(lobe, light))) << i;
    }
    ASSERT_LT(glm::distance(neutral.total(light), plain.total(light)), 1e-9 * (1.0 + glm::length(plain.total(light))));
  }
}

TEST(ExtendedBsdf, NeverGivesBackMoreThanArrives) {
  for (const auto& [name, extensions] : each_extension()) {
    for (const double roughness : {0.0, 0.2, 0.6, 1.0}) {
      for (const double polar : {0.0, 0.6, 1.1, 1.4, 1.53}) {
        const glm::dvec3 viewer = direction(polar, 0.3);
        const auto expect_kept = [&](const MaterialPoint& material, bool inside, const char* what) {
          const double left = albedo(bsdf_of(extended(material, extensions), viewer, inside, Carried::Flux));
          EXPECT_LE(left, 1.0 + 4e-3) << name << ' ' << what << ' ' << roughness << ' ' << polar;
        };
        expect_kept(test::metal(roughness, 1.0), false, "metal");
        expect_kept(test::glass(roughness), false, "glass");
        expect_kept(test::glass(roughness), true, "inside of glass");
        expect_kept(test::sheet(roughness), false, "sheet");
        MaterialPoint half = test::glass(roughness);
        half.transmission = 0.5;
        expect_kept(half, false, "half glass");
      }
    }
  }
}

TEST(ExtendedBsdf, LosesNothingWhereItsModelKeepsAll) {
  ExtensionPoint specular;
  specular.specular = 0.5;
  ExtensionPoint colored;
  colored.specular_color = glm::dvec3(2.0);
  ExtensionPoint film;
  film.iridescence = 1.0;
  film.iridescence_nm = 0.0;
  for (const ExtensionPoint& extensions : {specular, colored, film}) {
    for (const double polar : {0.0, 0.7, 1.4}) {
      for (const bool solid : {false, true}) {
        for (const double transmission : {0.5, 1.0}) {
          MaterialPoint glass = solid ? test::glass(0.0) : test::sheet(0.0);
          glass.transmission = transmission;
          if (transmission < 1.0 && extensions.iridescence > 0.0) continue;
          EXPECT_NEAR(albedo(bsdf_of(extended(glass, extensions), direction(polar, 0.3), false, Carried::Flux)), 1.0,
                      4e-3)
              << polar << ' ' << solid << ' ' << transmission;
        }
      }
    }
  }
  ExtensionPoint leaf;
  leaf.diffuse_transmission = 0.3;
  const Bsdf white = bsdf_of(extended(test::dielectric(0.5, 1.0, 1.0), leaf), direction(0.9, 0.0));
  EXPECT_NEAR(albedo(white, Lobe::Diffuse), 0.7, 1e-9);
  EXPECT_NEAR(albedo(white, Lobe::DiffuseTransmission), 0.3, 1e-9);
}

TEST(ExtendedBsdf, ScattersTheSameWithLightAndViewerSwapped) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (const auto& [name, extensions] : each_extension()) {
    for (int i = 0; i < 300; ++i) {
      MaterialPoint material = test::dielectric(0.1 + 0.9 * uniform(random), 0.8);
      material.metallic = i % 3 == 0 ? 0.5 : 0.0;
      material.transmission = i % 2 == 0 ? 0.0 : 0.7;
      material.solid = i % 4 == 1;
      const MaterialPoint with = extended(material, extensions);
      const glm::dvec3 a = direction(1.4 * uniform(random), 6.28 * uniform(random));
      const glm::dvec3 b = direction(1.4 * uniform(random), 6.28 * uniform(random));
      for (const Lobe lobe : {Lobe::Diffuse, Lobe::Reflection, Lobe::Coat}) {
        // Values of the coat hold the cosine to the light, over that of the surface.
        const auto sent = [&](const glm::dvec3& from, const glm::dvec3& to) {
          const double cosine =
              lobe == Lobe::Coat ? from.z / std::max(1e-9, glm::dot(extensions.clearcoat_normal, from)) : 1.0;
          return bsdf_of(with, to).value(lobe, from) * cosine;
        };
        const glm::dvec3 there = sent(a, b);
        const glm::dvec3 back = sent(b, a);
        for (int c = 0; c < 3; ++c) ASSERT_NEAR(there[c], back[c], 1e-9 * (1.0 + there[c])) << name << ' ' << i;
      }
      SurfacePoint within = test::seen_from(-b, true);
      within.geometric_normal = within.shading_normal = -kUp;
      ExtensionPoint turned = extensions;
      turned.clearcoat_normal = -extensions.clearcoat_normal;
      MaterialPoint below = extended(material, turned);
      below.normal = -kUp;
      for (const Lobe lobe : {Lobe::Transmission, Lobe::DiffuseTransmission}) {
        const double squeeze = lobe == Lobe::Transmission && material.solid ? 2.25 : 1.0;
        const double there = bsdf_of(with, a).value(lobe, -b).g;
        const double back = Bsdf(below, within).value(lobe, a).g / squeeze;
        ASSERT_NEAR(there, back, 1e-9 * (1.0 + there)) << name << ' ' << i << ' ' << static_cast<int>(lobe);
      }
    }
  }
}

TEST(ExtendedBsdf, SpecularScalesTheDielectricsReflection) {
  ExtensionPoint extensions;
  extensions.specular = 0.5;
  extensions.specular_color = {1.0, 0.5, 30.0};
  const MaterialPoint smooth = extended(test::dielectric(0.0, 0.5), extensions);
  const glm::dvec3 straight = bsdf_of(smooth, kUp).weight(Lobe::Reflection);
  EXPECT_NEAR(straight.r, 0.5 * 0.04, 1e-12);
  EXPECT_NEAR(straight.g, 0.5 * 0.02, 1e-12);
  EXPECT_NEAR(straight.b, 0.5, 1e-12) << "no base reflects more than all";
  EXPECT_NEAR(bsdf_of(smooth, direction(1.5707, 0.0)).weight(Lobe::Reflection).g, 0.5, 1e-3) << "at grazing angles";
  // An index of 0 leaves the colour alone, as materials of specular colour and glossiness have it.
  extensions.specular = 1.0;
  extensions.specular_color = {0.2, 0.3, 0.4};
  const Bsdf colored = bsdf_of(extended(test::dielectric(0.0, 0.5, 0.0), extensions), kUp);
  EXPECT_NEAR(colored.weight(Lobe::Reflection).r, 0.2, 1e-12);
  EXPECT_NEAR(colored.value(Lobe::Diffuse, kUp).g, 0.5 * 0.6 / std::numbers::pi, 1e-12);
  EXPECT_FALSE(bsdf_of(extended(test::metal(0.4, 0.5), extensions), kUp).present(Lobe::Coat));
}

TEST(ExtendedBsdf, ACoatReflectsByItsOwnRoughnessAndNormal) {
  ExtensionPoint extensions;
  extensions.clearcoat = 0.5;
  extensions.clearcoat_normal = direction(0.2, 0.0);
  const Bsdf bsdf = bsdf_of(extended(test::dielectric(0.6, 0.0), extensions), direction(0.5, 0.0));
  EXPECT_TRUE(bsdf.is_delta(Lobe::Coat));
  EXPECT_FALSE(bsdf.is_delta(Lobe::Reflection));
  const auto reflected = bsdf.sample(Lobe::Coat, {0.1, 0.2});
  ASSERT_TRUE(reflected);
  EXPECT_LT(glm::distance(reflected->direction, direction(0.1, std::numbers::pi)), 1e-12);
  EXPECT_NEAR(reflected->weight.g, 0.5 * (0.04 + 0.96 * std::pow(1.0 - std::cos(0.3), 5.0)), 1e-12);
  // Looked at straight the base loses what the coat reflects.
  extensions.clearcoat_normal = kUp;
  const MaterialPoint lambert = test::dielectric(0.6, 1.0, 1.0);
  EXPECT_NEAR(bsdf_of(extended(lambert, extensions), kUp).value(Lobe::Diffuse, kUp).g,
              (1.0 - 0.5 * 0.04) / std::numbers::pi, 1e-12);
}

TEST(ExtendedBsdf, AnisotropyBlursAlongItsDirection) {
  ExtensionPoint extensions;
  extensions.anisotropy = 0.8;
  extensions.anisotropy_direction = {1.0, 0.0, 0.0};
  const Bsdf bsdf = bsdf_of(extended(test::metal(0.3, 1.0), extensions), kUp);
  const double along = bsdf.value(Lobe::Reflection, direction(0.5, 0.0)).g;
  const double across = bsdf.value(Lobe::Reflection, direction(0.5, std::numbers::pi / 2.0)).g;
  EXPECT_GT(along, 20.0 * across);
  // D = 1 / (pi a_t a_b), with a_b = 0.09 and a_t = 0.09 + 0.91 0.64.
  EXPECT_NEAR(bsdf.value(Lobe::Reflection, kUp).g, 1.0 / (4.0 * std::numbers::pi * 0.09 * 0.6724), 1e-9);
}

TEST(ThinFilm, OfNoThicknessIsTheBase) {
  for (const double f0 : {0.02, 0.04, 0.5, 0.95}) {
    for (const double cosine : {1.0, 0.8, 0.3}) {
      const double schlick = f0 + (1.0 - f0) * std::pow(1.0 - cosine, 5.0);
      EXPECT_NEAR(thin_film_fresnel(cosine, 1.33, 0.0, glm::dvec3(f0)).g, schlick, 2e-3) << f0 << ' ' << cosine;
    }
  }
}

/// Airy's sum at one wavelength, whose mean over a channel's the film's is about, looked at straight.
TEST(ThinFilm, InterferesAsAirysSumSays) {
  const auto airy = [](double ior, double nm, double f0, double wavelength) {
    const double base = (1.0 + std::sqrt(f0)) / (1.0 - std::sqrt(f0));
    const double r12 = (1.0 - ior) / (1.0 + ior);
    const double r23 = (ior - base) / (ior + base);
    const double phase = 4.0 * std::numbers::pi * ior * nm / wavelength;
    const double up = r12 * r12 + r23 * r23 + 2.0 * r12 * r23 * std::cos(phase);
    return up / (1.0 + r12 * r12 * r23 * r23 + 2.0 * r12 * r23 * std::cos(phase));
  };
  // Green light is about 545 nm: a film of a quarter of it, and of a half.
  for (const double ior : {1.3, 1.8}) {
    for (const double part : {0.25, 0.5}) {
      const double nm = part * 545.0 / ior;
      EXPECT_NEAR(thin_film_fresnel(1.0, ior, nm, glm::dvec3(0.3)).g, airy(ior, nm, 0.3, 545.0), 0.03)
          << ior << ' ' << part;
    }
  }
  for (double nm = 0.0; nm < 1200.0; nm += 37.0) {
    for (const double cosine : {0.0, 0.01, 0.5, 1.0}) {
      const glm::dvec3 film = thin_film_fresnel(cosine, 1.5, nm, {0.0, 0.04, 1.0});
      for (int c = 0; c < 3; ++c) EXPECT_TRUE(film[c] >= 0.0 && film[c] <= 1.0) << nm << ' ' << cosine;
    }
  }
}

TEST(Sheen, AlbedoIsTheIntegralAndNoMoreThanAll) {
  for (const double roughness : {0.11, 0.15, 0.3, 0.5, 0.77, 1.0}) {
    for (const double polar : {0.0, 0.5, 1.0, 1.3, 1.4, 1.5}) {
      const glm::dvec3 viewer = direction(polar, 0.0);
      constexpr int kSteps = 256;
      const Sheen sheen(roughness, viewer.z);
      double sum = 0.0;
      for (int i = 0; i < kSteps; ++i) {
        const double u = (i + 0.5) / kSteps;
        const double cosine = u * u;
        for (int j = 0; j < kSteps; ++j) {
          const glm::dvec3 light = direction(std::acos(cosine), std::numbers::pi * (j + 0.5) / kSteps);
          sum += sheen.value(cosine, glm::normalize(viewer + light).z) * cosine * 2.0 * u;
        }
      }
      const double integral = sum * 2.0 * std::numbers::pi / (kSteps * kSteps);
      EXPECT_LE(integral, 1.0) << roughness << ' ' << polar;
      EXPECT_NEAR(sheen_albedo(roughness, viewer.z), integral, 0.004) << roughness << ' ' << polar;
    }
  }
}

TEST(Dispersion, BendsByTheAbbeNumberAndKeepsTheLight) {
  // Diamond: 1.5 at most, an Abbe number of 20 / 0.5.
  MaterialPoint glass = test::glass(0.0, 1.5);
  glass.ior_spread = 0.025 * 0.5 * 0.5;
  ASSERT_TRUE(disperses(glass));
  glm::dvec3 sum(0.0);
  glm::dvec3 indices(0.0);
  constexpr int kChoices = 3000;
  for (int i = 0; i < kChoices; ++i) {
    MaterialPoint chosen = glass;
    choose_channel(chosen, {0.5, 0.2, 0.3}, (i + 0.5) / kChoices);
    ASSERT_FALSE(disperses(chosen));
    indices[chosen.channel] = chosen.ior;
    const glm::dvec3 weight = bsdf_of(chosen, kUp, false, Carried::Flux).weight(Lobe::Transmission);
    EXPECT_EQ(weight[(chosen.channel + 1) % 3], 0.0);
    sum += weight / static_cast<double>(kChoices);
  }
  EXPECT_NEAR((1.5 - 1.0) / (indices.b - indices.r), 40.0, 1e-9);
  EXPECT_EQ(indices.g, 1.5);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(sum[c], 0.96, 2e-3) << c;
  MaterialPoint red = glass;
  choose_channel(red, {0.25, 0.0, 0.0}, 0.999);
  EXPECT_EQ(red.channel, 0);
  EXPECT_EQ(red.channel_scale, 1.0F) << "light of one channel stays as bright";
}

/// All channels in one direction have each the light that they have alone, also about the critical angle from within.
TEST(Dispersion, WideLobesServeAllChannels) {
  MaterialPoint glass = test::glass(0.3, 1.5);
  glass.ior_spread = 0.06;
  ASSERT_TRUE(Bsdf::shares_directions(glass));
  const auto albedo_of = [](const Bsdf& bsdf, Lobe lobe) {
    constexpr std::uint32_t kSamples = 1U << 15U;
    glm::dvec3 sum(0.0);
    for (std::uint32_t i = 0; i < kSamples; ++i) {
      Sampler random(5, i);
      if (const auto sample = bsdf.sample(lobe, random.two())) sum += sample->weight;
    }
    return sum / static_cast<double>(kSamples);
  };
  for (const bool inside : {false, true}) {
    for (const double polar : {0.1, 0.6, 0.73, 0.8, 1.2}) {
      const glm::dvec3 viewer = direction(polar, 0.3);
      const Bsdf all = bsdf_of(glass, viewer, inside);
      for (const Lobe lobe : {Lobe::Reflection, Lobe::Transmission}) {
        const glm::dvec3 together = albedo_of(all, lobe);
        const glm::dvec3 turned = albedo_of(bsdf_of(glass, kUp, inside).seen_from(viewer, kUp), lobe);
        for (int c = 0; c < 3; ++c) {
          MaterialPoint only = glass;
          set_channel(only, c, 1.0);
          const double alone = albedo_of(bsdf_of(only, viewer, inside), lobe)[c];
          EXPECT_NEAR(together[c], alone, 0.004) << inside << ' ' << polar << ' ' << static_cast<int>(lobe) << ' ' << c;
          EXPECT_EQ(turned[c], together[c]);
        }
      }
    }
  }
}

}  // namespace
}  // namespace hpr
