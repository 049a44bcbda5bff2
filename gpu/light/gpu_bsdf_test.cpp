#include <hpr/shaders/bsdf_values.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "gpu/device/test_kernels.h"
#include "gpu/light/gpu_materials.h"
#include "gpu/light/test_scenes.h"
#include "rt/materials/bsdf.h"
#include "rt/materials/material_point.h"
#include "rt/photons/photon_query.h"

namespace hpr {
namespace {

using GpuBsdf = test::OnGpu;

/// As in test_surfaces.glsl.
struct PlainPoint {
  glm::dvec3 base_color{1.0};
  double metallic = 0.0;
  double roughness = 1.0;
  double transmission = 0.0;
  double ior = 1.5;
  glm::dvec3 normal{0.0};
  double ior_spread = 0.0;
  float channel_scale = 1.0F;
  std::uint32_t channel = MaterialPoint::kAllChannels;
  std::uint32_t unlit = 0;
  std::uint32_t solid = 0;
  std::uint32_t extended = 0;
  std::uint32_t padding = 0;
  ExtensionPoint extensions;

  [[nodiscard]] MaterialPoint material() const {
    MaterialPoint point;
    point.base_color = base_color;
    point.metallic = metallic;
    point.roughness = roughness;
    point.transmission = transmission;
    point.ior = ior;
    point.normal = normal;
    point.ior_spread = ior_spread;
    point.channel_scale = channel_scale;
    point.channel = static_cast<std::uint8_t>(channel);
    point.unlit = unlit != 0;
    point.solid = solid != 0;
    if (extended != 0) point.extensions = std::make_shared<const ExtensionPoint>(extensions);
    return point;
  }
};

/// As bsdf_values.comp reads them.
struct BsdfUse {
  test::PlainSurface surface;
  PlainPoint material;
  glm::dvec3 to_light{0.0};
  glm::dvec2 u{0.0};
  double glossy_cutoff = 0.0;
  std::uint32_t lobe = 0;
  std::uint32_t flux = 0;
  std::uint32_t summed = 0;  ///< bits of lobes
  std::uint32_t padding = 0;

  [[nodiscard]] Bsdf bsdf() const {
    return {material.material(), surface.surface(), flux != 0 ? Carried::Flux : Carried::Radiance};
  }
};

/// As bsdf_values.comp writes them.
struct FoundBsdf {
  std::array<glm::dvec3, kLobes.size()> values;
  std::array<double, kLobes.size()> pdfs;
  glm::dvec3 value;
  double pdf;
  glm::dvec3 sum;
  glm::dvec3 weight;
  glm::dvec3 light_normal;
  double roughness;
  glm::dvec3 direction;
  glm::dvec3 sample_weight;
  double sample_pdf;
  std::uint32_t has_sample;
  std::uint32_t is_present;
  std::uint32_t is_delta;
  std::uint32_t is_followed;
};

constexpr std::uint32_t kDiffuseBit = 1;
constexpr std::uint32_t kSpecularBits = 2 + 8;
constexpr std::uint32_t kAllBits = 31;

glm::dvec3 sum_of(const Bsdf& bsdf, const BsdfUse& use) {
  if (use.summed == kAllBits) return bsdf.total(use.to_light);
  return bsdf.reflected(use.to_light, use.summed == kDiffuseBit, use.summed == kSpecularBits);
}

FoundBsdf expected_of(const BsdfUse& use) {
  const Bsdf bsdf = use.bsdf();
  const Lobe lobe = kLobes.at(use.lobe);
  const Scattering all = bsdf.scattering(use.to_light);
  const auto sample = bsdf.sample(lobe, use.u);
  const BsdfSample drawn = sample.value_or(BsdfSample());
  return {.values = all.value,
          .pdfs = all.pdf,
          .value = bsdf.value(lobe, use.to_light),
          .pdf = bsdf.pdf(lobe, use.to_light),
          .sum = sum_of(bsdf, use),
          .weight = bsdf.weight(lobe),
          .light_normal = bsdf.light_normal(),
          .roughness = bsdf.roughness(lobe),
          .direction = drawn.direction,
          .sample_weight = drawn.weight,
          .sample_pdf = drawn.pdf,
          .has_sample = sample ? 1U : 0U,
          .is_present = bsdf.present(lobe) ? 1U : 0U,
          .is_delta = bsdf.is_delta(lobe) ? 1U : 0U,
          .is_followed = is_followed(bsdf, lobe, use.glossy_cutoff) ? 1U : 0U};
}

/// The largest difference of what was found and what is expected, relative to that or to 1e-6 where that is less.
double difference_of(const FoundBsdf& found, const FoundBsdf& expected) {
  double largest = 0.0;
  const auto add = [&](double a, double b) {
    if (a == b) return;
    const double error = std::abs(a - b) / std::max(std::abs(b), 1e-6);
    largest = error <= largest ? largest : error;  // NaN counts
  };
  const auto add_all = [&](const glm::dvec3& a, const glm::dvec3& b) {
    for (int c = 0; c < 3; ++c) add(a[c], b[c]);
  };
  for (std::size_t i = 0; i < kLobes.size(); ++i) {
    add_all(found.values.at(i), expected.values.at(i));
    add(found.pdfs.at(i), expected.pdfs.at(i));
  }
  add_all(found.value, expected.value);
  add(found.pdf, expected.pdf);
  add_all(found.sum, expected.sum);
  add_all(found.weight, expected.weight);
  add_all(found.light_normal, expected.light_normal);
  add(found.roughness, expected.roughness);
  add(found.has_sample, expected.has_sample);
  add(found.is_present, expected.is_present);
  add(found.is_delta, expected.is_delta);
  add(found.is_followed, expected.is_followed);
  if (found.has_sample == 0 || expected.has_sample == 0) return largest;
  if (!(glm::length(found.direction - expected.direction) <= 1e-9)) add(found.direction.x, 1e9);
  add_all(found.sample_weight, expected.sample_weight);
  return largest;
}

PlainPoint random_point(test::Random& random, const test::PlainSurface& surface) {
  PlainPoint made;
  made.base_color = random.color();
  made.metallic = random.chance(0.6) ? 0.0 : random.factor();
  made.roughness = random.chance(0.1)   ? 0.0
                   : random.chance(0.3) ? std::exp(random.between(-7.6, 0.0))
                                        : random.factor();
  if (random.chance(0.6)) made.transmission = random.factor();
  made.ior = std::array{0.0, 1.0, 1.33, 1.5, 2.4}.at(random.below(5));
  made.normal = surface.surface().facing_normal();
  if (random.chance(0.3)) {
    const glm::dvec3 mapped = glm::normalize(made.normal + 0.5 * random.direction());
    if (glm::dot(mapped, surface.to_viewer) > 0.0) made.normal = mapped;
  }
  made.unlit = random.chance(0.02) ? 1 : 0;
  made.solid = random.below(2);
  if (made.ior <= 1.0 || !random.chance(0.4)) return made;
  made.ior_spread = random.factor(0.0, 0.2);
  if (!random.chance(0.5)) return made;
  MaterialPoint chosen = made.material();
  set_channel(chosen, static_cast<int>(random.below(3)), random.between(1.0, 3.0));
  made.channel = chosen.channel;
  made.channel_scale = chosen.channel_scale;
  made.ior = chosen.ior;
  return made;
}

/// The square of the sine between the normal and the half vector.
double mirrored_sine2(const BsdfUse& use) {
  const glm::dvec3 half = glm::normalize(use.surface.to_viewer + use.to_light);
  const glm::dvec3 across = glm::cross(use.material.normal, half);
  return glm::dot(across, across);
}

ExtensionPoint random_extensions(test::Random& random, const test::PlainSurface& surface) {
  ExtensionPoint made;
  const auto has = [&] { return random.chance(0.4); };
  if (has()) made.specular = random.factor();
  if (has()) made.specular_color = random.color(2.0);
  if (has()) made.clearcoat = random.factor();
  made.clearcoat_roughness = random.chance(0.3) ? 0.0 : std::exp(random.between(-7.6, 0.0));
  made.clearcoat_normal = surface.surface().facing_normal();
  if (has()) made.sheen_color = random.color();
  made.sheen_roughness = random.factor();
  if (has()) made.anisotropy = random.factor();
  made.anisotropy_direction = glm::normalize(glm::cross(surface.shading_normal, random.direction()));
  if (has()) made.iridescence = random.factor();
  made.iridescence_ior = random.factor(1.0, 2.4);
  made.iridescence_nm = random.factor(0.0, 1000.0);
  if (has()) made.diffuse_transmission = random.factor();
  made.diffuse_transmission_color = random.color();
  return made;
}

/// From anywhere, or from where the lobe scatters.
glm::dvec3 random_light(test::Random& random, const BsdfUse& use) {
  if (random.chance(0.6)) {
    if (const auto sample = use.bsdf().sample(kLobes.at(use.lobe), random.two())) return sample->direction;
  }
  const glm::dvec3& normal = use.surface.geometric_normal;
  return test::random_above(random, random.chance(0.7) ? normal : -normal);
}

BsdfUse random_use(test::Random& random, bool extended) {
  BsdfUse use;
  use.surface = test::random_surface(random, 1);
  use.material = random_point(random, use.surface);
  if (extended) {
    use.material.extended = 1;
    use.material.extensions = random_extensions(random, use.surface);
  }
  use.lobe = random.below(extended ? kLobes.size() : 3);
  use.flux = random.below(2);
  use.summed = std::array{kDiffuseBit, kSpecularBits, kAllBits}.at(random.below(3));
  use.u = random.two();
  use.glossy_cutoff = random.number();
  use.to_light = random_light(random, use);
  if (!(mirrored_sine2(use) > 1e-5)) use.material.extensions.sheen_color = glm::dvec3(0.0);
  return use;
}

/// By how much results may differ: cosines of grazing directions have few digits, and so have facets of narrow lobes.
struct ErrorBounds {
  double values = 0.0;
  double sample_pdf = 0.0;  ///< of directions that differ themselves by their rounding
};

ErrorBounds bounds_of(const BsdfUse& use, const FoundBsdf& expected) {
  const PlainPoint& material = use.material;
  const bool extended = material.extended != 0;
  const auto cosine = [&](const glm::dvec3& direction) {
    const double plain = std::abs(glm::dot(material.normal, direction));
    return extended ? std::min(plain, std::abs(glm::dot(material.extensions.clearcoat_normal, direction))) : plain;
  };
  const double narrowest = std::min(material.roughness, extended ? material.extensions.clearcoat_roughness : 1.0);
  const double alpha = std::max(narrowest * narrowest, 1e-6);
  const double view = cosine(use.surface.to_viewer);
  const double sampled = expected.has_sample != 0 ? cosine(expected.direction) : 1.0;
  // Nearly mirrored light has few digits of its half vector's sine, of which sheen is a power.
  double sheen = 0.0;
  if (extended && material.extensions.sheen_color != glm::dvec3(0.0)) {
    const double sheen_alpha = std::max(std::pow(material.extensions.sheen_roughness, 2.0), 5e-3);
    sheen = 1e-15 / (sheen_alpha * mirrored_sine2(use));
  }
  return {1e-11 + 1e-14 / std::min(view, cosine(use.to_light)) + 1e-15 / alpha + sheen,
          1e-11 + 1e-14 / (alpha * std::min(view, sampled))};
}

void expect_same(const GpuDevice& device, std::span<const BsdfUse> uses) {
  Scene scene;
  MaterialExtensions sheen;
  sheen.sheen_color = glm::vec3(1.0F);
  scene.materials.emplace_back().extensions = std::make_shared<const MaterialExtensions>(sheen);
  const GpuMaterials uploaded(device, scene);
  const auto found = test::map_on_gpu<FoundBsdf>(device, bsdf_values, uses, uploaded.address());
  // Where roots of what is almost 0 lose half of the digits: seen straight on, or about the critical angle.
  constexpr double kMaxOutlier = 1e-6;
  std::size_t outliers = 0;
  std::array<std::size_t, kLobes.size()> scattered{};
  std::array<std::size_t, kLobes.size()> sampled{};
  for (std::size_t i = 0; i < uses.size(); ++i) {
    const FoundBsdf expected = expected_of(uses[i]);
    const ErrorBounds bounds = bounds_of(uses[i], expected);
    const double difference = difference_of(found[i], expected);
    ASSERT_LE(difference, bounds.values + kMaxOutlier) << i;
    if (difference > bounds.values) ++outliers;
    if (expected.value != glm::dvec3(0.0)) ++scattered.at(uses[i].lobe);
    if (expected.has_sample == 0) continue;
    ++sampled.at(uses[i].lobe);
    ASSERT_LE(std::abs(found[i].sample_pdf - expected.sample_pdf),
              (bounds.sample_pdf + kMaxOutlier) * expected.sample_pdf)
        << i;
  }
  EXPECT_LE(outliers, uses.size() / 5000);
  for (std::uint32_t lobe = 0; lobe < kLobes.size(); ++lobe) {
    const auto of_lobe =
        static_cast<std::size_t>(std::ranges::count(uses, lobe, [](const BsdfUse& use) { return use.lobe; }));
    EXPECT_GE(scattered.at(lobe), of_lobe / 10) << lobe;
    EXPECT_GE(sampled.at(lobe), of_lobe / 5) << lobe;
  }
}

TEST_F(GpuBsdf, ScattersAsTheCpus) {
  test::Random random(13);
  std::vector<BsdfUse> uses(100'000);
  for (BsdfUse& use : uses) use = random_use(random, false);
  expect_same(device(), uses);
}

TEST_F(GpuBsdf, ScattersWithExtensionsAsTheCpus) {
  test::Random random(14);
  std::vector<BsdfUse> uses(100'000);
  for (BsdfUse& use : uses) use = random_use(random, true);
  expect_same(device(), uses);
}

}  // namespace
}  // namespace hpr
