// Whether directions are drawn with the density that Bsdf::pdf tells: Pearson's chi-square over rings and sectors
// around the middle of each lobe, fine where the lobe is narrow.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "rt/materials/test_bsdf.h"
#include "rt/sampling/sampler.h"

namespace hpr {
namespace {

using test::bsdf_of;
using test::direction;

constexpr int kSectors = 8;
constexpr int kSamples = 40'000;

/// Directions by their angle from an axis, in rings whose widths double, and around it, in sectors.
class Rings {
 public:
  Rings(const glm::dvec3& axis, double narrowest) : axis_(axis) {
    const glm::dvec3 helper = std::abs(axis.z) < 0.9 ? glm::dvec3(0, 0, 1) : glm::dvec3(1, 0, 0);
    first_ = glm::normalize(glm::cross(helper, axis));
    second_ = glm::cross(axis, first_);
    edges_ = {0.0};
    for (double edge = narrowest; edge < std::numbers::pi / 1.3; edge *= 1.5) edges_.push_back(edge);
    edges_.push_back(std::numbers::pi);
  }

  [[nodiscard]] std::size_t bins() const { return (edges_.size() - 1) * kSectors; }

  [[nodiscard]] std::size_t bin_of(const glm::dvec3& d) const {
    // atan2 keeps the digits that acos loses near the axis.
    const double angle = std::atan2(glm::length(glm::cross(axis_, d)), glm::dot(axis_, d));
    const auto after = std::ranges::upper_bound(edges_, angle);
    const auto ring = std::min(static_cast<std::size_t>(after - edges_.begin()) - 1, edges_.size() - 2);
    const double around = std::atan2(glm::dot(second_, d), glm::dot(first_, d)) / (2.0 * std::numbers::pi) + 0.5;
    return ring * kSectors + std::min(static_cast<std::size_t>(around * kSectors), std::size_t{kSectors - 1});
  }

  /// The integral of `density` over each bin: the midpoint rule, refined until it settles. At grazing angles lobes are
  /// a hundred times narrower across than along, and the horizon cuts them.
  template <typename Density>
  [[nodiscard]] std::vector<double> integrals(const Density& density, int first_steps) const {
    std::vector<double> sums(bins());
    for (std::size_t bin = 0; bin < sums.size(); ++bin) {
      double before = integral(density, bin, first_steps);
      for (int steps = 3 * first_steps; steps < 500; steps *= 3) {
        sums[bin] = integral(density, bin, steps);
        if (std::abs(sums[bin] - before) <= 2e-3 * sums[bin] + 1e-7) break;
        before = sums[bin];
      }
    }
    return sums;
  }

 private:
  template <typename Density>
  [[nodiscard]] double integral(const Density& density, std::size_t bin, int steps) const {
    const double low = edges_[bin / kSectors];
    const double step = (edges_[bin / kSectors + 1] - low) / steps;
    const double turn = 2.0 * std::numbers::pi / kSectors;
    const double start = turn * static_cast<double>(bin % kSectors) - std::numbers::pi;
    double sum = 0.0;
    for (int i = 0; i < steps; ++i) {
      const double angle = low + (i + 0.5) * step;
      double ring = 0.0;
      for (int j = 0; j < steps; ++j) {
        const double around = start + turn * (j + 0.5) / steps;
        ring += density(std::cos(angle) * axis_ +
                        std::sin(angle) * (std::cos(around) * first_ + std::sin(around) * second_));
      }
      sum += ring * std::sin(angle) * step * turn / steps;
    }
    return sum;
  }

  glm::dvec3 axis_;
  glm::dvec3 first_;
  glm::dvec3 second_;
  std::vector<double> edges_;
};

/// Expects the counts to be what `expected` shares of all samples make plausible: the last bin is for failures.
void expect_plausible(const std::vector<double>& expected, const std::vector<int>& counted) {
  double statistic = 0.0;
  int freedom = -1;
  double pooled_expected = 0.0;
  double pooled_count = 0.0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    pooled_expected += expected[i] * kSamples;
    pooled_count += counted[i];
    if (pooled_expected < 8.0 && i + 1 < expected.size()) continue;
    if (pooled_expected < 1.0) {
      EXPECT_LT(pooled_count, 12.0) << "where next to none were expected";
      break;
    }
    statistic += (pooled_count - pooled_expected) * (pooled_count - pooled_expected) / pooled_expected;
    ++freedom;
    pooled_expected = pooled_count = 0.0;
  }
  if (freedom < 1) return;
  // Wilson and Hilferty 1931: the cube root of chi-square over its degrees of freedom is nearly normal.
  const double spread = 2.0 / (9.0 * freedom);
  const double deviation = (std::cbrt(statistic / freedom) - (1.0 - spread)) / std::sqrt(spread);
  EXPECT_LT(deviation, 4.5) << "chi-square " << statistic << " of " << freedom;
}

void expect_drawn_by_its_density(const Bsdf& bsdf, Lobe lobe, double narrowest, int first_steps) {
  const auto center = bsdf.sample(lobe, {0.0, 0.0});
  const glm::dvec3 axis = center ? center->direction : test::kUp;
  const Rings rings(axis, narrowest);
  std::vector<double> expected = rings.integrals([&](const glm::dvec3& d) { return bsdf.pdf(lobe, d); }, first_steps);
  double total = 0.0;
  for (const double integral : expected) total += integral;
  EXPECT_LT(total, 1.004) << "the density integrates to more than 1";
  expected.push_back(std::max(0.0, 1.0 - total));

  std::vector<int> counted(expected.size(), 0);
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    // Independent numbers: those of one stream are spread more evenly than chance, which would hide faults.
    Sampler random(0x9E3779B97F4A7C15U * (i + 1), 0);
    const auto sample = bsdf.sample(lobe, random.two());
    if (!sample) {
      ++counted.back();
      continue;
    }
    ++counted[rings.bin_of(sample->direction)];
    const double pdf = bsdf.pdf(lobe, sample->direction);
    ASSERT_NEAR(sample->pdf / pdf, 1.0, 1e-6);
    const glm::dvec3 value = bsdf.value(lobe, sample->direction);
    for (int c = 0; c < 3; ++c) {
      const double weight = value[c] * std::abs(sample->direction.z) / pdf;
      ASSERT_NEAR(sample->weight[c], weight, 1e-6 * (1.0 + weight));
    }
  }
  expect_plausible(expected, counted);
}

const std::vector<double> kAngles{0.0, 0.7, 1.2, 1.45, 1.56};

/// Roughness 0.05 has facets within some 0.0025 rad.
void expect_all(const MaterialPoint& material, Lobe lobe, bool inside, const std::string& what) {
  for (const double polar : kAngles) {
    const double narrowest = 0.3 * material.roughness * material.roughness * std::cos(polar);
    SCOPED_TRACE(what + ", roughness " + std::to_string(material.roughness) + ", angle " + std::to_string(polar));
    expect_drawn_by_its_density(bsdf_of(material, direction(polar, 0.4), inside), lobe, narrowest,
                                polar < 1.3 ? 12 : 40);
  }
}

TEST(BsdfSampling, DiffuseDirectionsFollowTheirDensity) {
  expect_all(test::dielectric(0.7, 0.5), Lobe::Diffuse, false, "diffuse");
}

TEST(BsdfSampling, DiffuseDirectionsFollowTheirDensityWhereLightIsLetThroughToo) {
  MaterialPoint material = test::glass(0.7);
  material.transmission = 0.5;
  expect_all(material, Lobe::Diffuse, false, "half glass");
  expect_all(material, Lobe::Diffuse, true, "out of half glass");
}

TEST(BsdfSampling, ReflectedDirectionsFollowTheirDensity) {
  for (const double roughness : {0.05, 0.3, 1.0}) {
    expect_all(test::metal(roughness, 0.9), Lobe::Reflection, false, "metal");
  }
}

TEST(BsdfSampling, DirectionsThroughASheetFollowTheirDensity) {
  for (const double roughness : {0.05, 0.4, 1.0}) {
    expect_all(test::sheet(roughness), Lobe::Transmission, false, "sheet");
  }
}

TEST(BsdfSampling, DirectionsIntoGlassFollowTheirDensity) {
  for (const double roughness : {0.05, 0.4, 1.0}) {
    expect_all(test::glass(roughness), Lobe::Transmission, false, "into glass");
  }
  expect_all(test::glass(0.7, 3.0), Lobe::Transmission, false, "into dense glass");
}

TEST(BsdfSampling, DirectionsOutOfGlassFollowTheirDensity) {
  for (const double roughness : {0.05, 0.4, 1.0}) {
    expect_all(test::glass(roughness), Lobe::Transmission, true, "out of glass");
  }
  expect_all(test::glass(0.7, 3.0), Lobe::Transmission, true, "out of dense glass");
}

TEST(BsdfSampling, DirectionsOfExtensionsFollowTheirDensity) {
  ExtensionPoint coat;
  coat.clearcoat = 0.7;
  coat.clearcoat_normal = direction(0.1, 2.5);
  ExtensionPoint leaf;
  leaf.diffuse_transmission = 0.4;
  leaf.sheen_color = glm::dvec3(0.3);
  ExtensionPoint brushed;
  brushed.anisotropy = 0.8;
  brushed.anisotropy_direction = {0.6, 0.8, 0.0};
  ExtensionPoint film;
  film.iridescence = 1.0;
  film.iridescence_nm = 300.0;
  film.specular = 0.6;
  for (const double roughness : {0.2, 0.7}) {
    coat.clearcoat_roughness = roughness;
    expect_all(test::extended(test::dielectric(roughness, 0.6), coat), Lobe::Coat, false, "coat");
    expect_all(test::extended(test::metal(roughness, 0.9), brushed), Lobe::Reflection, false, "brushed metal");
  }
  expect_all(test::extended(test::dielectric(0.5, 0.6), leaf), Lobe::DiffuseTransmission, false, "leaf");
  expect_all(test::extended(test::dielectric(0.3, 0.6), film), Lobe::Reflection, false, "film");
  expect_all(test::extended(test::glass(0.4), film), Lobe::Transmission, false, "glass under a film");
}

/// A part of whose directions comes from all over the hemisphere, up to its edge: in bins of equal area.
TEST(BsdfSampling, DirectionsOfSheenFollowTheirDensity) {
  constexpr int kRings = 16;
  constexpr int kSteps = 16;
  ExtensionPoint sheen;
  sheen.sheen_color = {0.9, 0.4, 0.1};
  sheen.sheen_roughness = 0.6;
  for (const double polar : kAngles) {
    const Bsdf bsdf = bsdf_of(test::extended(test::dielectric(0.5, 0.6), sheen), direction(polar, 0.4));
    std::vector<double> expected;
    for (int ring = 0; ring < kRings; ++ring) {
      double sum = 0.0;
      for (int step = 0; step < kSteps; ++step) {
        sum += bsdf.pdf(Lobe::Diffuse, direction(std::acos((ring + (step + 0.5) / kSteps) / kRings), 1.0));
      }
      expected.insert(expected.end(), kSectors, sum / kSteps * 2.0 * std::numbers::pi / (kRings * kSectors));
    }
    expected.push_back(0.0);
    std::vector<int> counted(expected.size(), 0);
    double estimate = 0.0;
    for (std::uint32_t i = 0; i < kSamples; ++i) {
      Sampler random(0x9E3779B97F4A7C15U * (i + 1), 0);
      const auto sample = bsdf.sample(Lobe::Diffuse, random.two());
      ASSERT_TRUE(sample);
      const glm::dvec3& d = sample->direction;
      const double around = std::atan2(d.y, d.x) / (2.0 * std::numbers::pi) + 0.5;
      const int sector = std::min(static_cast<int>(around * kSectors), kSectors - 1);
      ++counted[static_cast<std::size_t>(std::min(static_cast<int>(d.z * kRings), kRings - 1) * kSectors + sector)];
      ASSERT_NEAR(sample->weight.r, bsdf.value(Lobe::Diffuse, d).r * d.z / sample->pdf, 1e-9);
      ASSERT_LT(sample->weight.r, 16.0);
      estimate += sample->weight.r / kSamples;
    }
    SCOPED_TRACE(polar);
    expect_plausible(expected, counted);
    EXPECT_LT(estimate, 1.0);
  }
}

TEST(BsdfSampling, DensitiesHoldUnderATiltedShadingNormal) {
  for (const Lobe lobe : {Lobe::Diffuse, Lobe::Reflection}) {
    SurfacePoint surface = test::seen_from(direction(0.6, 0.4));
    MaterialPoint material = test::dielectric(0.5, 0.8);
    material.normal = direction(0.5, 2.0);
    const Bsdf bsdf(material, surface);
    const Rings rings(material.normal, 0.05);
    const auto integrals = rings.integrals([&](const glm::dvec3& d) { return bsdf.pdf(lobe, d); }, 16);
    double total = 0.0;
    for (const double integral : integrals) total += integral;
    int drawn = 0;
    for (std::uint32_t i = 0; i < kSamples; ++i) {
      Sampler random(0x9E3779B97F4A7C15U * (i + 1), 0);
      const auto sample = bsdf.sample(lobe, random.two());
      if (!sample) continue;
      ++drawn;
      ASSERT_GT(sample->direction.z, 0.0) << "below the geometric surface";
    }
    const double chance = static_cast<double>(drawn) / kSamples;
    EXPECT_LT(chance, 0.999) << "some samples are to fail";
    EXPECT_NEAR(chance, total, 0.01);
  }
}

/// A lobe that is chosen with a chance in proportion to its weight and then brings many times as much is a firefly.
TEST(BsdfSampling, NoSampleOutweighsTheChanceOfItsLobe) {
  std::vector<MaterialPoint> materials;
  for (const double roughness : {0.05, 0.1, 0.2, 0.4, 1.0}) {
    for (const double ior : {1.05, 1.33, 1.5, 2.4}) {
      materials.push_back(test::glass(roughness, ior));
      materials.push_back(test::sheet(roughness, ior));
      materials.push_back(test::dielectric(roughness, 0.8, ior));
      materials.push_back(test::glass(roughness, ior));
      materials.back().transmission = 0.5;
      materials.back().metallic = 0.2;
    }
    materials.push_back(test::metal(roughness, 0.9));
  }
  double worst = 0.0;
  for (const MaterialPoint& material : materials) {
    for (double polar = 0.0; polar < 1.57; polar += polar < 1.5 ? 0.06 : 0.01) {
      for (const bool inside : {false, true}) {
        const Bsdf bsdf = bsdf_of(material, direction(polar, 0.4), inside, Carried::Flux);
        for (const Lobe lobe : kLobes) {
          const glm::dvec3 expected = bsdf.weight(lobe);
          for (std::uint32_t i = 0; i < 200; ++i) {
            Sampler random(0x9E3779B97F4A7C15U * (i + 1), 0);
            const auto sample = bsdf.sample(lobe, random.two());
            if (!sample) continue;
            const double ratio = sample->weight.x / expected.x;
            worst = std::max(worst, ratio);
            ASSERT_LT(ratio, 50.0) << "lobe " << static_cast<int>(lobe) << ", roughness " << material.roughness
                                   << ", index " << material.ior << ", angle " << polar << (inside ? ", inside" : "");
          }
        }
      }
    }
  }
  EXPECT_GT(worst, 1.0);
}

}  // namespace
}  // namespace hpr
