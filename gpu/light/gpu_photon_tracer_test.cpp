#include "gpu/light/gpu_photon_tracer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/parallel.h"
#include "gpu/device/test_gpu.h"
#include "gpu/gpu_scene.h"
#include "gpu/light/gpu_lights.h"
#include "gpu/light/gpu_materials.h"
#include "gpu/light/gpu_surfaces.h"
#include "rt/photons/test_photons.h"
#include "rt/test_rooms.h"
#include "scene/load_scene.h"

namespace hpr {
namespace {

/// A scene whose photons the CPU traces, and a device.
struct Traced : test::PhotonRoom {
  Traced(const GpuDevice& device, Scene built, bool extended)
      : PhotonRoom(std::move(built)),
        lights(scene),
        on_device(device, scene, std::array{SurfaceRange{0, scene.triangles}}, 2),
        surfaces_there(device, scene, surfaces),
        materials(device, scene),
        lights_there(device, scene, lights, materials),
        tracer_there(device,
                     {on_device.address(), surfaces_there.address(), materials.address(), lights_there.address()},
                     extended) {}

  [[nodiscard]] PhotonTracer on_cpu(const PhotonSettings& settings) const {
    return tracer([this](double choice, const glm::dvec2& position,
                         const glm::dvec2& direction) { return lights.emit(choice, position, direction); },
                  settings);
  }

  LightSampler lights;
  GpuScene on_device;
  GpuSurfaces surfaces_there;
  GpuMaterials materials;
  GpuLights lights_there;
  GpuPhotonTracer tracer_there;
};

/// How a device's photons agree with the CPU's.
struct Agreement {
  std::uint64_t photons = 0;
  std::uint64_t kept = 0;
  std::uint64_t equal = 0;       ///< of the kept ones: to the bit
  std::uint64_t near = 0;        ///< but for rounding to single precision
  std::uint64_t elsewhere = 0;   ///< photons sent that arrive at other surfaces, from some bounce on
  std::uint64_t unfinished = 0;  ///< of the photons sent
  PhotonCounts cpu;
  PhotonCounts gpu;
};

bool nearly(const std::array<float, 3>& a, const std::array<float, 3>& b, double allowed) {
  const glm::dvec3 one(a[0], a[1], a[2]);
  const glm::dvec3 other(b[0], b[1], b[2]);
  return glm::distance(one, other) <= allowed * std::max(glm::length(one), 1e-30);
}

bool nearly(const Photon& a, const Photon& b) {
  return nearly(a.position, b.position, 1e-6) && nearly(a.flux, b.flux, 1e-6) &&
         glm::distance(unpack_direction(a.direction), unpack_direction(b.direction)) < 2e-4 &&
         std::abs(a.traveled - b.traveled) <= 1e-5F * a.traveled;
}

void compare(const TracedPhotons& cpu, std::span<const KeptPhoton> gpu, Agreement& found) {
  std::size_t next_caustic = 0;
  std::size_t next_global = 0;
  std::uint64_t alike = 0;
  for (const KeptPhoton& one : gpu) {
    const std::vector<Photon>& kind = one.caustic ? cpu.caustic : cpu.global;
    const std::size_t i = one.caustic ? next_caustic++ : next_global++;
    if (i >= kind.size() || !nearly(kind[i], one.stored)) continue;
    ++alike;
    found.equal += kind[i] == one.stored ? 1U : 0U;
  }
  const std::size_t expected = cpu.caustic.size() + cpu.global.size();
  found.kept += expected;
  found.near += alike;
  found.elsewhere += alike == expected && gpu.size() == expected ? 0U : 1U;
}

/// What the device leaves of photons, as many at once as it takes.
DevicePhotons trace_on_device(GpuPhotonTracer& device, const PhotonSettings& settings, const PhotonRange& range) {
  DevicePhotons all;
  for (std::uint64_t done = 0; done < range.count; done += device.max_photons()) {
    const PhotonRange some{range.first + done, std::min(device.max_photons(), range.count - done)};
    const DevicePhotons found =
        device.trace({photon_stream({}), some, 1.0 / static_cast<double>(range.count), settings, {}});
    const auto before = static_cast<std::uint32_t>(done);
    for (const KeptPhoton& one : found.kept) all.kept.push_back({one.photon + before, one.caustic, one.stored});
    for (const std::uint32_t photon : found.unfinished) all.unfinished.push_back(photon + before);
    all.counts += found.counts;
  }
  return all;
}

Agreement compare(Traced& room, PhotonSettings settings, std::uint64_t first, std::uint64_t photons) {
  const PhotonTracer cpu = room.on_cpu(settings);
  std::vector<TracedPhotons> expected(photons);
  parallel_for(2, photons, [&](std::size_t i) { expected[i] = cpu.trace({}, {first + i, 1}, photons); });
  const DevicePhotons found = trace_on_device(room.tracer_there, settings, {first, photons});
  Agreement agreement;
  agreement.photons = photons;
  agreement.unfinished = found.unfinished.size();
  agreement.gpu = found.counts;
  auto next = found.kept.begin();
  auto unfinished = found.unfinished.begin();
  for (std::uint32_t i = 0; i < photons; ++i) {
    const auto begin = next;
    while (next != found.kept.end() && next->photon == i) ++next;
    if (unfinished != found.unfinished.end() && *unfinished == i) {
      ++unfinished;
      EXPECT_TRUE(begin == next) << "an unfinished photon was kept";
      continue;
    }
    agreement.cpu += expected[i].counts;
    compare(expected[i], std::span(begin, next), agreement);
  }
  EXPECT_TRUE(next == found.kept.end()) << "kept out of order";
  return agreement;
}

class GpuPhotonTracerTest : public test::OnGpu {
 protected:
  /// Expects the CPU's photons, but for those of which rounding leads to another surface.
  void expect_as_cpu(Scene scene, bool extended, std::uint64_t photons, double kept_each,
                     const PhotonSettings& settings = {}) {
    constexpr double kElsewhere = 1e-3;
    Traced room(device(), std::move(scene), extended);
    // Past 2^32 photons have numbers of another stream.
    const Agreement found = compare(room, settings, (std::uint64_t{1} << 32U) - photons / 2, photons);
    const auto sent = static_cast<double>(photons);
    EXPECT_GT(static_cast<double>(found.kept), kept_each * sent);
    EXPECT_LE(static_cast<double>(found.elsewhere), kElsewhere * sent);
    EXPECT_GE(static_cast<double>(found.equal), (1.0 - kElsewhere) * static_cast<double>(found.kept));
    EXPECT_LE(static_cast<double>(found.unfinished), 0.01 * sent);
    EXPECT_EQ(found.gpu.sent, found.cpu.sent);
    EXPECT_EQ(found.gpu.lost, found.cpu.lost);
    const auto rays = static_cast<double>(found.cpu.rays);
    EXPECT_NEAR(static_cast<double>(found.gpu.rays), rays, kElsewhere * rays);
  }
};

TEST_F(GpuPhotonTracerTest, PhotonsOfARoomAreThoseOfTheCpu) {
  expect_as_cpu(load_scene("gen:cornell"), false, 100'000, 1.0);
}

TEST_F(GpuPhotonTracerTest, PhotonsOfAGalleryAreThoseOfTheCpu) {
  expect_as_cpu(load_scene("gen:gallery"), false, 20'000, 3.0);
}

/// A room with a lamp of limited range, a sun and a sky, and something in the center.
Scene lit_room(const Material& thing) {
  Scene scene = test::room(thing, false);
  Light lamp;
  lamp.position = {0.3, 0.5, 0.4};
  lamp.intensity = {3.0F, 2.0F, 1.0F};
  lamp.range = 2.0;
  lamp.radius = 0.05;
  Light sun;
  sun.type = LightType::Directional;
  sun.direction = {0.3F, -0.4F, -1.0F};
  scene.lights = {lamp, sun};
  scene.environment = test::even_light({0.2F, 0.3F, 0.4F});
  return scene;
}

Material with(Material material, const MaterialExtensions& extensions) {
  material.extensions = std::make_shared<const MaterialExtensions>(extensions);
  return material;
}

TEST_F(GpuPhotonTracerTest, PhotonsOfExtendedMaterialsAreThoseOfTheCpu) {
  Material jelly = test::clear_glass(1.4F, 1.0F);
  jelly.attenuation_distance = 0.3F;
  jelly.attenuation_color = {0.9F, 0.4F, 0.2F};
  Material metal = test::mirror(0.8F);
  metal.roughness = 0.3F;
  MaterialExtensions coat;
  coat.clearcoat = 1.0F;
  MaterialExtensions velvet;
  velvet.sheen_color = glm::vec3(0.8F);
  velvet.anisotropy = 0.7F;
  MaterialExtensions disperses;
  disperses.dispersion = 2.0F;
  for (const Material& thing : {with(metal, coat), with(metal, velvet), with(jelly, disperses)}) {
    expect_as_cpu(lit_room(thing), true, 4'000, 1.0, {.glossy_cutoff = 0.2});
  }
}

TEST_F(GpuPhotonTracerTest, CausticsAloneAndPathsCutShortAreThoseOfTheCpu) {
  const Scene scene = lit_room(test::clear_glass(1.5F, 1.0F));
  expect_as_cpu(scene, false, 8'000, 0.01, {.caustics_only = true});
  expect_as_cpu(scene, false, 8'000, 0.5, {.max_bounces = 2});
}

bool same(const TracedPhotons& a, const TracedPhotons& b) {
  return a.caustic == b.caustic && a.global == b.global && a.counts == b.counts;
}

TEST_F(GpuPhotonTracerTest, RangesChangeNoBit) {
  Traced room(device(), lit_room(test::mirror(0.9F)), false);
  PhotonTracer tracer = room.on_cpu({.threads = 2});
  tracer.trace_on(&room.tracer_there);
  const TracedPhotons all = tracer.trace({}, {5, 9'000}, 9'000);
  TracedPhotons parts;
  for (const PhotonRange& range : {PhotonRange{5, 300}, PhotonRange{305, 8'695}, PhotonRange{9'000, 5}}) {
    const TracedPhotons part = tracer.trace({}, range, 9'000);
    parts.caustic.insert(parts.caustic.end(), part.caustic.begin(), part.caustic.end());
    parts.global.insert(parts.global.end(), part.global.begin(), part.global.end());
    parts.counts += part.counts;
  }
  EXPECT_GT(all.counts.caustic, 100U);
  EXPECT_TRUE(same(parts, all));
  EXPECT_TRUE(same(tracer.trace({}, {7, 0}, 1), {}));
}

/// A floor whose normals lean towards a grazing light sends on more photons than the device has room for.
TEST_F(GpuPhotonTracerTest, LeavesToTheCpuWhatItCannotFinish) {
  Scene scene = test::room(test::mirror(0.9F), false);
  for (glm::vec3& normal : scene.meshes[4].normals) normal = glm::vec3(std::sqrt(0.99F), 0.1F, 0.0F);
  Light lamp;
  lamp.position = {0.9, -0.95, 0.0};
  lamp.intensity = glm::vec3(1.0F);
  scene.lights = {lamp};
  Traced room(device(), std::move(scene), false);
  const Agreement found = compare(room, {}, 0, 3'000);
  EXPECT_GT(found.unfinished, 10U);
  PhotonTracer tracer = room.on_cpu({.threads = 2});
  const TracedPhotons expected = tracer.trace({}, {0, 3'000}, 3'000);
  tracer.trace_on(&room.tracer_there);
  const TracedPhotons traced = tracer.trace({}, {0, 3'000}, 3'000);
  EXPECT_EQ(traced.counts, expected.counts);
  ASSERT_EQ(traced.global.size(), expected.global.size());
  std::size_t near = 0;
  for (std::size_t i = 0; i < traced.global.size(); ++i) near += nearly(expected.global[i], traced.global[i]) ? 1U : 0U;
  EXPECT_EQ(near, traced.global.size());
  PhotonTracer few = room.on_cpu({.max_kept = expected.global.size() / 2});
  few.trace_on(&room.tracer_there);
  EXPECT_THROW((void)few.trace({}, {0, 3'000}, 3'000), Error);
}

TEST_F(GpuPhotonTracerTest, ScenesWithoutLightAndLightWithoutASceneAreFine) {
  Scene unlit;
  test::add_room(unlit, test::add_material(unlit, test::diffuse()));
  Traced dark(device(), std::move(unlit), false);
  DevicePhotons left = trace_on_device(dark.tracer_there, {}, {0, 100});
  EXPECT_TRUE(left.kept.empty() && left.unfinished.empty());
  EXPECT_EQ(left.counts, PhotonCounts{});
  Light lamp;
  lamp.intensity = glm::vec3(1.0F);
  Scene empty;
  empty.lights = {lamp};
  Traced lit(device(), std::move(empty), false);
  left = trace_on_device(lit.tracer_there, {}, {0, 100});
  EXPECT_TRUE(left.kept.empty() && left.unfinished.empty());
  EXPECT_EQ(left.counts.sent, 100U);
}

TEST(GpuPhotonRefusals, AreSaid) {
  Scene scene = load_scene("gen:cornell");
  EXPECT_EQ(refusal_of_photons(scene), "");
  scene.materials[0].alpha_mode = AlphaMode::Blend;
  EXPECT_EQ(refusal_of_photons(scene), "photons that pass surfaces of partial coverage are the CPU's");
}

}  // namespace
}  // namespace hpr
