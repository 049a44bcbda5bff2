#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <numeric>
#include <random>
#include <span>
#include <vector>

#include "rt/photons/photon_map.h"
#include "rt/photons/photon_query.h"
#include "rt/ray_settings.h"

// A million photons on the walls of a room: sorting them into a map, and the light of about 50 gathered at a place. The
// floor of a build is to move each photon once to where it belongs, a scattered copy; that of a gather is to read and
// sum fifty photons that lie side by side somewhere.
namespace {

constexpr std::size_t kPhotons = 1'000'000;
constexpr double kGathered = 50.0;
constexpr double kGlossyCutoff = 0.3;

struct SurfaceSample {
  glm::dvec3 position;
  glm::dvec3 normal;
};

/// On the faces of the cube [-1, 1]^3, from inside.
SurfaceSample random_sample(std::mt19937_64& random) {
  std::uniform_real_distribution<double> side(-1.0, 1.0);
  const auto axis = static_cast<int>(random() % 3);
  SurfaceSample sample{{side(random), side(random), side(random)}, glm::dvec3(0.0)};
  sample.position[axis] = random() % 2 == 0 ? -1.0 : 1.0;
  sample.normal[axis] = -sample.position[axis];
  return sample;
}

std::vector<hpr::Photon> photons_of_a_room() {
  std::mt19937_64 random(1);
  std::vector<hpr::Photon> photons(kPhotons);
  for (hpr::Photon& photon : photons) {
    const SurfaceSample sample = random_sample(random);
    for (int axis = 0; axis < 3; ++axis)
      photon.position[static_cast<std::size_t>(axis)] = static_cast<float>(sample.position[axis]);
    photon.facing = hpr::pack_facing(sample.normal);
    photon.direction = hpr::pack_direction(sample.normal - 0.5 * sample.position);
    photon.flux = {1e-6F, 2e-6F, 3e-6F};
  }
  return photons;
}

/// A place as the picture shows it, of rough plastic: seen from in front, a little from the side.
struct ShadedPoint {
  explicit ShadedPoint(const SurfaceSample& sample) {
    surface.position = sample.position;
    surface.geometric_normal = surface.shading_normal = material.normal = sample.normal;
    surface.to_viewer = glm::normalize(2.0 * sample.normal - sample.position);
    material.roughness = 0.5;
    bsdf = hpr::Bsdf(material, surface);
  }
  hpr::SurfacePoint surface;
  hpr::MaterialPoint material;
  hpr::Bsdf bsdf;
};

hpr::RaySpace room_space() {
  return hpr::RaySpace(hpr::Bounds{glm::dvec3(-1.0), glm::dvec3(1.0)});
}

double room_radius() {
  return std::sqrt(kGathered * 24.0 / (std::numbers::pi * static_cast<double>(kPhotons)));
}

void photon_build(benchmark::State& state) {
  const std::vector<hpr::Photon> photons = photons_of_a_room();
  for (auto _ : state) {
    const hpr::PhotonMap map(photons, room_space(), room_radius());
    benchmark::DoNotOptimize(map.size());
  }
}
BENCHMARK(photon_build)->Unit(benchmark::kMillisecond);

/// Every photon to a random place of its own.
void photon_scattered_copy(benchmark::State& state) {
  const std::vector<hpr::Photon> photons = photons_of_a_room();
  std::vector<std::uint32_t> to(kPhotons);
  std::iota(to.begin(), to.end(), 0U);
  std::shuffle(to.begin(), to.end(), std::mt19937_64(2));
  for (auto _ : state) {
    const auto copy = std::make_unique_for_overwrite<hpr::Photon[]>(kPhotons);
    for (std::size_t i = 0; i < kPhotons; ++i) copy[to[i]] = photons[i];
    benchmark::DoNotOptimize(copy.get());
  }
}
BENCHMARK(photon_scattered_copy)->Unit(benchmark::kMillisecond);

void photon_gather(benchmark::State& state) {
  const hpr::PhotonMap map(photons_of_a_room(), room_space(), room_radius());
  std::mt19937_64 random(3);
  std::vector<SurfaceSample> samples(1 << 16);
  for (SurfaceSample& sample : samples) sample = random_sample(random);
  if (state.range(0) != 0) {
    // As neighbouring pixels come: a walk over one wall.
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const std::size_t row = i / 256;
      const double across = static_cast<double>(i % 256) / 128.0 - 1.0;
      samples[i] = {{across, -1.0, static_cast<double>(row) / 128.0 - 1.0}, {0.0, 1.0, 0.0}};
    }
  }
  std::size_t gathered = 0;
  for (const SurfaceSample& sample : samples) gathered += map.count(sample.position, sample.normal);
  hpr::FoundPhotons found;
  std::size_t i = 0;
  for (auto _ : state) {
    const ShadedPoint point(samples[i++ % samples.size()]);
    benchmark::DoNotOptimize(
        hpr::gather_photons(map, map.radius(), point.surface, point.bsdf, point.material.normal, kGlossyCutoff, found));
  }
  state.counters["photons"] = static_cast<double>(gathered) / static_cast<double>(samples.size());
}
BENCHMARK(photon_gather)->ArgName("neighbours")->Arg(0)->Arg(1);

void photon_sum_side_by_side(benchmark::State& state) {
  const std::vector<hpr::Photon> photons = photons_of_a_room();
  std::mt19937_64 random(4);
  std::vector<std::size_t> firsts(1 << 16);
  for (std::size_t& first : firsts) first = random() % (kPhotons - 50);
  std::size_t i = 0;
  for (auto _ : state) {
    glm::dvec3 sum(0.0);
    const std::span<const hpr::Photon> fifty = std::span(photons).subspan(firsts[i++ % firsts.size()], 50);
    for (const hpr::Photon& photon : fifty) {
      const glm::dvec3 from = hpr::unpack_direction(photon.direction);
      sum += from.x * glm::dvec3(photon.flux[0], photon.flux[1], photon.flux[2]);
    }
    benchmark::DoNotOptimize(sum);
  }
}
BENCHMARK(photon_sum_side_by_side);

}  // namespace

BENCHMARK_MAIN();
