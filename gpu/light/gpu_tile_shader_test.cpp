#include "gpu/light/gpu_tile_shader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <memory>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "gpu/device/test_gpu.h"
#include "rt/test_scene.h"
#include "rt/trace/coverage_traversal.h"
#include "rt/trace/primary_rays.h"
#include "scene/load_scene.h"
#include "scene/requirements.h"

namespace hpr {
namespace {

using test::add_material;
using test::add_mesh;
using test::place_mesh;
using test::quad;

View view_of(const Scene& scene, const Size& size) {
  View view = make_view(scene.cameras.empty() ? framing_camera(scene) : scene.cameras.front(), size, scene.bounds);
  view.jitter = {0.21, -0.37};
  view.screen_number = 2;
  return view;
}

/// One view's pixels, lit by the CPU or by a device.
struct Lit {
  std::vector<Rgb> pixels;
  std::vector<float> coverage;
  RayCounts counts;
  double by_cpu_ms = 0.0;     ///< direct light that the CPU computed
  double by_device_ms = 0.0;  ///< beside its kernels
};

class GpuTileShaderTest : public test::OnGpu {
 protected:
  Lit light(const Scene& scene, const RaySettings& settings, const View& view, bool by_device,
            const SampleNumber& number = {3, 5}) {
    const Requirements requirements = requirements_of(scene);
    const RayScene rays(scene, RaySpace(scene), 2, covering_surfaces(scene, false));
    const FrameLayout layout({view.size()});
    TileLayer<Key> keys(layout);
    PrimaryRays(scene, rays, 2).draw(view, 0, std::array{Rect{0, 0, view.size().width, view.size().height}}, keys);
    EXPECT_EQ(refusal_of_light(scene, settings), "");
    MakeTileShader make;
    if (by_device) {
      make = [&](const ShadingInputs& inputs) { return std::make_unique<GpuTileShader>(device(), inputs, 2); };
    }
    DeferredShader shader(scene, settings, requirements, {}, nullptr, make);
    TileLayer<Rgb> radiance(layout);
    TileLayer<float> coverage(layout);
    std::vector<std::size_t> tiles(layout.tiles());
    std::iota(tiles.begin(), tiles.end(), std::size_t{0});
    shader.shade(std::array{view}, keys, tiles, {.radiance = &radiance, .coverage = &coverage}, number);
    Lit lit;
    for (int y = 0; y < view.size().height; ++y) {
      for (int x = 0; x < view.size().width; ++x) {
        lit.pixels.push_back(radiance.at(0, x, y));
        lit.coverage.push_back(coverage.at(0, x, y));
      }
    }
    lit.counts = shader.counts();
    for (const PassTime& time : shader.times()) {
      lit.by_cpu_ms += time.name == "direct" ? time.ms : 0.0;
      lit.by_device_ms += time.name == "device rest" ? time.ms : 0.0;
    }
    EXPECT_EQ(lit.by_device_ms > 0.0, by_device);
    return lit;
  }

  /// Expects that a device lights as the CPU does: the same numbers lead the same rays, so pixels are equal but where a
  /// ray meets an edge.
  void expect_as_cpu(const Scene& scene, const RaySettings& settings, const View& view, const std::string& what,
                     double others = 0.01) {
    SCOPED_TRACE(what);
    const Lit cpu = light(scene, settings, view, false);
    const Lit gpu = light(scene, settings, view, true);
    double sum = 0.0;
    double other_sum = 0.0;
    std::size_t lit = 0;
    std::size_t off = 0;
    for (std::size_t i = 0; i < cpu.pixels.size(); ++i) {
      const glm::dvec3 a(cpu.pixels[i].r, cpu.pixels[i].g, cpu.pixels[i].b);
      const glm::dvec3 b(gpu.pixels[i].r, gpu.pixels[i].g, gpu.pixels[i].b);
      const double bright = std::max({a.r, a.g, a.b});
      sum += a.r + a.g + a.b;
      other_sum += b.r + b.g + b.b;
      lit += bright > 0.0 ? 1U : 0U;
      off += glm::distance(a, b) > 1e-4 * bright + 1e-7 ? 1U : 0U;
      ASSERT_EQ(cpu.coverage[i], gpu.coverage[i]) << i;
    }
    const auto pixels = static_cast<double>(cpu.pixels.size());
    EXPECT_GT(static_cast<double>(lit), 0.2 * pixels);
    EXPECT_LE(static_cast<double>(off), others * pixels);
    EXPECT_NEAR(other_sum / sum, 1.0, 0.005);
    EXPECT_EQ(gpu.by_cpu_ms, 0.0) << "the CPU lit some tiles";
    EXPECT_EQ(gpu.counts.primary, cpu.counts.primary);
    EXPECT_EQ(gpu.counts.cut, cpu.counts.cut);
    for (const PassId pass :
         {PassId::Shadow, PassId::Reflection, PassId::Refraction, PassId::AmbientOcclusion, PassId::Gather}) {
      const auto traced = static_cast<double>(cpu.counts[pass]);
      EXPECT_NEAR(static_cast<double>(gpu.counts[pass]), traced, 0.01 * traced + 1.0) << static_cast<int>(pass);
    }
  }
};

RaySettings plain_settings() {
  RaySettings settings;
  settings.threads = 2;
  return settings;
}

TEST_F(GpuTileShaderTest, IsThatOfTheCpu) {
  const Scene scene = load_scene("gen:gallery");
  expect_as_cpu(scene, plain_settings(), view_of(scene, {64, 48}), "gallery");
}

TEST_F(GpuTileShaderTest, HasExtensions) {
  const Scene scene = load_scene("gen:extensions");
  expect_as_cpu(scene, plain_settings(), view_of(scene, {64, 48}), "extensions");
}

/// A room with textures, normal maps, a solid that absorbs and disperses, and an even sky that comes in by a window.
Scene furnished_room() {
  Scene scene = load_scene("gen:cornell");
  scene.environment = test::even_light({0.4F, 0.5F, 0.7F});
  Image<Rgba8> checks({4, 4});
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 4; ++x) {
      const auto level = static_cast<std::uint8_t>(60 + 40 * ((x + y) % 4));
      checks.at(x, y) = {level, static_cast<std::uint8_t>(240 - level), 230, 255};
    }
  }
  scene.textures.emplace_back().image = std::move(checks);
  Material tiles = test::diffuse();
  tiles.base_color_texture.texture = tiles.normal_texture.texture = tiles.metallic_roughness_texture.texture =
      static_cast<int>(scene.textures.size()) - 1;
  tiles.ior = 1.5F;
  Material jelly = test::clear_glass(1.4F, 1.0F);
  jelly.attenuation_distance = 0.3F;
  jelly.attenuation_color = {0.9F, 0.4F, 0.2F};
  const std::uint32_t ball = add_mesh(scene, test::sphere(0.25, 10, add_material(scene, jelly)));
  const std::uint32_t picture =
      add_mesh(scene, quad({-0.4F, -0.3F, 0}, {0.8F, 0, 0}, {0, 0.6F, 0}, add_material(scene, tiles)));
  const glm::dvec3 center = 0.5 * scene.bounds.low + 0.5 * scene.bounds.high;
  const double size = 0.5 * (scene.bounds.high.y - scene.bounds.low.y);
  place_mesh(scene, ball, glm::scale(glm::translate(glm::dmat4(1.0), center), glm::dvec3(size)));
  place_mesh(scene, picture,
             glm::scale(glm::translate(glm::dmat4(1.0), center - glm::dvec3(0.3 * size, -0.4 * size, 0.5 * size)),
                        glm::dvec3(size)));
  finish_scene(scene);
  return scene;
}

TEST_F(GpuTileShaderTest, GathersPhotonsAndLooksThroughMedia) {
  const Scene scene = furnished_room();
  RaySettings settings = plain_settings();
  settings.passes = {PassId::Shadow, PassId::Reflection, PassId::Refraction, PassId::AmbientOcclusion, PassId::Photon};
  settings.photons = 20'000;
  settings.global_photons = true;
  settings.light_samples = 2;
  expect_as_cpu(scene, settings, view_of(scene, {64, 48}), "room");
}

/// A floor with a glossy ball, a sign that lights nothing and a roof that the eye does not see, under an even sky.
Scene square() {
  Scene scene = test::white_floor();
  Material polished = test::mirror(0.9F);
  polished.roughness = 0.2F;
  Material sign = test::diffuse({0.9F, 0.8F, 0.1F});
  sign.unlit = true;
  const std::uint32_t ball = add_mesh(scene, test::sphere(0.6, 12, add_material(scene, polished)));
  place_mesh(scene, ball, glm::translate(glm::dmat4(1.0), glm::dvec3(0.0, 0.7, 0.0)));
  place_mesh(scene, add_mesh(scene, quad({-1, 0, -1}, {2, 0, 0}, {0, 1, 0}, add_material(scene, sign))));
  Material roof = test::diffuse({0.5F, 0.2F, 0.2F});
  roof.double_sided = false;
  place_mesh(scene, add_mesh(scene, quad({-1, 2, 1}, {2, 0, 0}, {0, 0, -2}, add_material(scene, roof))));
  scene.environment = test::even_light({0.4F, 0.6F, 0.8F});
  finish_scene(scene);
  return scene;
}

/// Rays gather all light there is: what meets the sky, signs, lamps and backdrops.
TEST_F(GpuTileShaderTest, GathersLightAlongRays) {
  RaySettings best = plain_settings();
  best.photons = 1'000;
  best.global_photons = best.gather = true;
  Scene scene = square();
  ASSERT_TRUE(runs_pass(plan_passes(requirements_of(scene), best), PassId::Gather));
  const View view = test::view_from({0.3, 1.5, 3}, {0, 0.4, 0}, {48, 32}, scene, 0.8);
  expect_as_cpu(scene, best, view, "an even sky");
  Scene glazed = scene;
  glazed.materials[0].ior = 1.5F;
  glazed.materials[0].roughness = 0.1F;
  finish_scene(glazed);
  RaySettings denoised = best;
  denoised.denoise = true;
  expect_as_cpu(glazed, denoised, view, "denoised", 0.02);
  RaySettings asked = plain_settings();
  asked.passes = {PassId::Gather};
  asked.glossy_cutoff = 0.1;
  expect_as_cpu(scene, asked, view, "no other pass");
  Light headlight;
  headlight.type = LightType::Headlight;
  scene.lights = {headlight};
  expect_as_cpu(scene, asked, view, "the headlight");
  scene.environment.reset();
  scene.background = {5.0F, 5.0F, 5.0F};
  Light lamp;
  lamp.position = {0.5, 1.5, 0.7};
  lamp.intensity = glm::vec3(20.0F);
  scene.lights = {lamp};
  finish_scene(scene);
  asked.passes = {PassId::Shadow, PassId::Reflection, PassId::Gather};
  expect_as_cpu(scene, asked, view, "a lamp before a backdrop");
}

/// Rays gather what photons tell, and leave caustics to them.
TEST_F(GpuTileShaderTest, GathersWhatPhotonsTell) {
  RaySettings best = plain_settings();
  best.photons = 5'000;
  best.global_photons = best.final_gather = true;
  best.photons_gathered = 30;
  Scene room = furnished_room();
  expect_as_cpu(room, best, view_of(room, {48, 32}), "room");
  best.denoise = true;
  expect_as_cpu(room, best, view_of(room, {48, 32}), "denoised", 0.05);
}

/// The CPU filters what the device lights: at margins, at edges, and where direct light stays with its pixel.
TEST_F(GpuTileShaderTest, IsDenoised) {
  RaySettings settings = plain_settings();
  settings.denoise = true;
  const Scene extensions = load_scene("gen:extensions");
  expect_as_cpu(extensions, settings, view_of(extensions, {72, 32}), "extensions", 0.02);
  settings.passes = {PassId::Shadow, PassId::Reflection, PassId::Refraction, PassId::AmbientOcclusion, PassId::Photon};
  settings.photons = 5'000;
  settings.global_photons = true;
  settings.filter_across_tiles = true;
  Scene room = furnished_room();
  for (Material& material : room.materials) {
    if (material.transmission == 0.0F) material.roughness = 0.2F;
  }
  Light lamp;
  const glm::dvec3 size = room.bounds.high - room.bounds.low;
  lamp.position = room.bounds.low + glm::dvec3(0.6, 0.7, 0.6) * size;
  lamp.intensity = glm::vec3(static_cast<float>(0.1 * size.y * size.y));
  room.lights.push_back(lamp);
  finish_scene(room);
  expect_as_cpu(room, settings, view_of(room, {72, 32}), "room", 0.05);  // a filter spreads a ray that differs
}

/// Glass that disperses and is hardly rough: chance picks a channel at the first surface, on the CPU before it does on
/// the device.
TEST_F(GpuTileShaderTest, DrawsWhatTheCpuDrawsWhereItIsDenoised) {
  Scene scene = test::white_floor();
  Material glass = test::clear_glass(1.5F, 1.0F);
  MaterialExtensions extensions;
  extensions.dispersion = 1.0F;
  glass.extensions = std::make_shared<const MaterialExtensions>(extensions);
  glass.roughness = 0.0015F;  // channels do not overlap
  const std::uint32_t ball = add_mesh(scene, test::sphere(0.6, 12, add_material(scene, glass)));
  place_mesh(scene, ball, glm::translate(glm::dmat4(1.0), glm::dvec3(0.0, 0.7, 0.0)));
  scene.environment = test::even_light({0.4F, 0.6F, 0.8F});
  finish_scene(scene);
  RaySettings settings = plain_settings();
  settings.denoise = true;
  expect_as_cpu(scene, settings, test::view_from({0.2, 3, 0.1}, {0.2, 0, 0}, {40, 32}, scene, 0.6), "glass", 0.02);
}

/// The room's furniture behind and among surfaces that cover in part, some of which stand before the open window.
Scene veiled_room() {
  Scene scene = furnished_room();
  const glm::dvec3 center = 0.5 * scene.bounds.low + 0.5 * scene.bounds.high;
  const auto size = static_cast<float>(scene.bounds.high.y - scene.bounds.low.y);
  Image<Rgba8> spots({4, 4});
  for (int i = 0; i < 16; ++i) spots.at(i % 4, i / 4) = {230, 180, 90, static_cast<std::uint8_t>(17 * i)};
  scene.textures.emplace_back().image = std::move(spots);
  Material veil = test::diffuse({0.8F, 0.5F, 0.3F});
  veil.double_sided = true;
  veil.ior = 1.5F;
  const auto add_pane = [&](AlphaMode mode, float alpha, bool is_textured, const glm::vec3& corner, float side) {
    Material material = veil;
    material.alpha_mode = mode;
    material.base_color.a = alpha;
    if (is_textured) material.base_color_texture.texture = static_cast<int>(scene.textures.size()) - 1;
    place_mesh(scene, add_mesh(scene, quad(glm::vec3(center) + size * corner, {size * side, 0, 0}, {0, size * side, 0},
                                           add_material(scene, material))));
  };
  for (int i = 0; i < 5; ++i) {
    const float at = 0.1F * static_cast<float>(i);
    add_pane(AlphaMode::Blend, 0.15F + at, i % 2 == 0, {at - 0.5F, at - 0.45F, 0.55F + 0.5F * at}, 0.5F);
  }
  scene.materials.back().emissive = {0.5F, 2.0F, 1.0F};
  for (int i = 0; i < 3; ++i) {  // in one plane
    const float at = 0.1F * static_cast<float>(i);
    add_pane(AlphaMode::Blend, 0.4F, false, {at, 0.1F - at, 0.4F}, 0.3F);
  }
  add_pane(AlphaMode::Mask, 1.0F, true, {-0.3F, -0.4F, 0.2F}, 0.6F);
  scene.materials.back().emissive = {2.0F, 0.5F, 0.5F};
  finish_scene(scene);
  return scene;
}

TEST_F(GpuTileShaderTest, LightsAlphaMaskAndBlend) {
  const Scene scene = veiled_room();
  const View view = view_of(scene, {48, 36});
  RaySettings settings = plain_settings();
  settings.denoise = true;
  expect_as_cpu(scene, settings, view, "veils, denoised", 0.02);
  settings.denoise = false;
  settings.passes = {PassId::Shadow, PassId::Reflection, PassId::Refraction, PassId::AmbientOcclusion, PassId::Photon};
  settings.photons = 20'000;
  settings.global_photons = true;
  settings.background.kind = Background::Kind::Environment;
  expect_as_cpu(scene, settings, view, "veils with photons");
}

/// More layers than places where they may wait; of samples that are denoised the CPU finds them, and none waits.
TEST_F(GpuTileShaderTest, LeavesManyLayersToTheCpu) {
  Scene scene = test::white_floor();
  Material thin = test::diffuse({0.5F, 0.6F, 0.7F});
  thin.alpha_mode = AlphaMode::Blend;
  thin.base_color.a = 0.05F;
  const std::uint32_t veil = add_material(scene, thin);
  for (int i = 0; i < 40; ++i) {
    place_mesh(scene, add_mesh(scene, quad({-2, 0.01F * static_cast<float>(i + 1), 2}, {4, 0, 0}, {0, 0, -4}, veil)));
  }
  finish_scene(scene);
  const View view = view_of(scene, {16, 12});
  const Lit cpu = light(scene, plain_settings(), view, false);
  const Lit gpu = light(scene, plain_settings(), view, true);
  EXPECT_EQ(gpu.pixels, cpu.pixels);
  EXPECT_GT(gpu.by_cpu_ms, 0.0) << "the device finished";
  RaySettings denoised = plain_settings();
  denoised.denoise = true;
  expect_as_cpu(scene, denoised, view, "denoised", 0.02);
}

/// So many layers of next to nothing that rays from the eye end among them: whoever traces them says so.
TEST_F(GpuTileShaderTest, SaysWhichRaysEndAmongLayers) {
  Scene scene = test::white_floor();
  Material next_to_nothing = test::diffuse();
  next_to_nothing.alpha_mode = AlphaMode::Blend;
  next_to_nothing.base_color.a = 1e-9F;
  next_to_nothing.double_sided = true;
  Mesh layers;
  layers.material = add_material(scene, next_to_nothing);
  for (std::uint32_t i = 0; i < kMaxPassed + 20; ++i) {
    const float y = 0.1F + 0.001F * static_cast<float>(i);
    layers.positions.insert(layers.positions.end(), {{-4, y, -4}, {-4, y, 4}, {4, y, 4}});
    layers.triangles.emplace_back(3 * i, 3 * i + 1, 3 * i + 2);
  }
  place_mesh(scene, add_mesh(scene, layers));
  scene.environment = test::even_light({0.4F, 0.6F, 0.8F});
  finish_scene(scene);
  RaySettings settings = plain_settings();
  settings.passes = {PassId::Reflection};
  const View view = test::view_from({0, 3, 0.1}, {0, 0, 0}, {8, 4}, scene, 0.6);
  const Lit cpu = light(scene, settings, view, false);
  testing::internal::CaptureStderr();
  const Lit gpu = light(scene, settings, view, true);
  EXPECT_NE(testing::internal::GetCapturedStderr().find("rays of a sample or a few passed 1000"), std::string::npos);
  EXPECT_EQ(gpu.by_cpu_ms, 0.0) << "the CPU lit some tiles";
  EXPECT_GT(gpu.counts.cut, 0U);
  EXPECT_EQ(gpu.counts.cut, cpu.counts.cut);
}

/// What a thread's loops may not do on a software device is done by the CPU.
TEST_F(GpuTileShaderTest, LeavesToTheCpuWhatItCannotFinish) {
  if (!device().info().software) GTEST_SKIP() << "GPUs do not end loops";
  Scene scene = test::white_floor();
  Light lamp;
  lamp.position = {0.5, 3.0, 0.0};
  lamp.intensity = glm::vec3(20.0F);
  scene.lights.push_back(lamp);
  // Rays to the lamp pass the empty halves of so many boxes.
  Mesh slopes;
  for (int i = 0; i < 30'000; ++i) {
    const auto first = static_cast<std::uint32_t>(slopes.positions.size());
    const float side = 4.0F + 1e-5F * static_cast<float>(i);
    slopes.positions.insert(slopes.positions.end(),
                            {{-side, 0.5F, side}, {side, 2.5F, side}, {side, 2.5F, side + 0.1F}});
    slopes.positions.insert(slopes.positions.end(),
                            {{-side, 0.5F, -side}, {-side, 2.5F, side}, {-side, 2.5F, side + 0.1F}});
    slopes.triangles.emplace_back(first, first + 1, first + 2);
    slopes.triangles.emplace_back(first + 3, first + 4, first + 5);
  }
  place_mesh(scene, add_mesh(scene, slopes));
  finish_scene(scene);
  const View view = view_of(scene, {32, 24});
  const Lit cpu = light(scene, plain_settings(), view, false);
  const Lit gpu = light(scene, plain_settings(), view, true);
  EXPECT_EQ(gpu.pixels, cpu.pixels);
  EXPECT_GT(gpu.by_cpu_ms, 0.0) << "the device finished";
}

TEST(TilesAtOnce, FitIntoMemory) {
  constexpr std::size_t kMegabyte = std::size_t{1} << 20U;
  const auto tiles = [](std::uint64_t megabytes, bool software) {
    GpuInfo device;
    device.memory = megabytes * kMegabyte;
    device.software = software;
    return tiles_at_once(device, 32 * kMegabyte);
  };
  EXPECT_EQ(tiles(80'000, true), 4U);
  EXPECT_EQ(tiles(80'000, false), 156U);  // 5000 MB of it
  EXPECT_EQ(tiles(16'384, false), 32U);
  EXPECT_EQ(tiles(512, false), 4U);
  EXPECT_EQ(tiles(std::uint64_t{1} << 30U, false), 256U);
}

TEST(GpuLightRefusals, AreSaid) {
  const Scene plain = load_scene("gen:cornell");
  const auto refusal = [](const Scene& scene, const auto& change) {
    RaySettings settings = plain_settings();
    change(settings);
    return refusal_of_light(scene, settings);
  };
  const auto nothing = [](RaySettings&) {};
  EXPECT_EQ(refusal(plain, nothing), "");
  EXPECT_EQ(refusal(plain, [](RaySettings& s) { s.reference = true; }), "the reference is the CPU's");
  EXPECT_EQ(refusal(plain, [](RaySettings& s) { s.show = Show::Normal; }), "what is shown is no light");
  EXPECT_EQ(refusal(plain, [](RaySettings& s) { s.half_resolution = {PassId::Shadow}; }),
            "passes at half resolution are the CPU's");
  EXPECT_EQ(refusal(plain, [](RaySettings& s) { s.part.emplace(); }), "rays travel between ranks");
  EXPECT_EQ(refusal(plain, [](RaySettings& s) { s.light_samples = 65; }), "more than 64 light samples are the CPU's");
  Scene coated = plain;
  MaterialExtensions coat;
  coat.clearcoat = 1.0F;
  coated.materials[0].extensions = std::make_shared<const MaterialExtensions>(coat);
  coated.materials[0].emissive = glm::vec3(1.0F);
  EXPECT_EQ(refusal(coated, nothing), "emission through clear coats is the CPU's");
}

/// Several screens, tiles at their edges, a mask, no bounces, and a background of its own.
class GpuTilesWithVeils : public GpuTileShaderTest, public testing::WithParamInterface<bool> {};

TEST_P(GpuTilesWithVeils, LightsMasksAndScreensOfAllKinds) {
  Scene scene = load_scene("gen:gallery");
  if (GetParam()) {
    Material veil = test::diffuse({0.8F, 0.5F, 0.3F});
    veil.alpha_mode = AlphaMode::Blend;
    veil.base_color.a = 0.6F;
    veil.double_sided = true;
    const glm::vec3 low = scene.bounds.low;
    const glm::vec3 size = scene.bounds.high - scene.bounds.low;
    const glm::vec3 corner = low + 0.4F * size;
    place_mesh(scene,
               add_mesh(scene, quad(corner, {0.4F * size.x, 0, 0}, {0, 0.4F * size.y, 0}, add_material(scene, veil))));
    finish_scene(scene);
  }
  View flat = view_of(scene, {70, 40});
  flat.orthographic = true;
  flat.near_distance = 0.01;
  flat.far_distance = 50.0;
  flat.left = flat.bottom = -2.0;
  flat.right = flat.top = 2.0;
  const std::array views{view_of(scene, {70, 50}), flat};
  RaySettings settings = plain_settings();
  settings.max_depth = 0;
  settings.background = {Background::Kind::Color, {0.2F, 0.3F, 0.4F}};
  const Requirements requirements = requirements_of(scene);
  const RayScene rays(scene, RaySpace(scene), 2, covering_surfaces(scene, false));
  const FrameLayout layout({views[0].size(), views[1].size()});
  TileLayer<Key> keys(layout);
  for (std::size_t screen = 0; screen < 2; ++screen) {
    const Size size = views.at(screen).size();
    PrimaryRays(scene, rays, 2).draw(views.at(screen), screen, std::array{Rect{0, 0, size.width, size.height}}, keys);
  }
  PixelMask wanted(layout);
  for (std::size_t tile = 0; tile < layout.tiles(); ++tile) {
    wanted.set_active(tile);
    for (std::size_t i = 0; i < kTilePixels; ++i) wanted.tile(tile)[i] = i % 3 == 0 && tile != 1 ? 1 : 0;
  }
  std::vector<std::size_t> tiles(layout.tiles());
  std::iota(tiles.begin(), tiles.end(), std::size_t{0});
  std::vector<TileLayer<Rgb>> lit;
  std::vector<std::uint64_t> found;
  for (const bool by_device : {false, true}) {
    MakeTileShader make;
    if (by_device) {
      make = [&](const ShadingInputs& inputs) { return std::make_unique<GpuTileShader>(device(), inputs, 2); };
    }
    DeferredShader shader(scene, settings, requirements, {}, nullptr, make);
    TileLayer<Rgb>& radiance = lit.emplace_back(layout);
    const ShadedSample sample{views, &keys, {.radiance = &radiance}, {1, 7}, &wanted};
    shader.shade(std::span(&sample, 1), tiles);
    EXPECT_EQ(shader.counts()[PassId::Reflection], 0U);
    found.push_back(shader.counts().primary);
  }
  std::size_t lit_pixels = 0;
  std::size_t others = 0;
  for (const std::size_t tile : tiles) {
    for (std::size_t i = 0; i < kTilePixels; ++i) {
      const Rgb& a = lit[0].tile(tile)[i];
      const Rgb& b = lit[1].tile(tile)[i];
      lit_pixels += a.r > 0.0F ? 1U : 0U;
      others += std::abs(a.r - b.r) + std::abs(a.g - b.g) + std::abs(a.b - b.b) > 1e-4F * (a.r + a.g + a.b) ? 1U : 0U;
    }
  }
  EXPECT_EQ(found[0], found[1]);
  EXPECT_EQ(found[0] > 0, GetParam());
  EXPECT_GT(lit_pixels, 500U);
  EXPECT_LE(others, lit_pixels / 200);
}

INSTANTIATE_TEST_SUITE_P(NoneAndOne, GpuTilesWithVeils, testing::Bool());

}  // namespace
}  // namespace hpr
