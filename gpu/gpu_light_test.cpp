#include "gpu/gpu_light.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <memory>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "gpu/test_gpu.h"
#include "rt/test_scene.h"
#include "rt/trace/primary_rays.h"
#include "scene/load_scene.h"
#include "scene/requirements.h"

namespace hpr {
namespace {

using test::add_material;
using test::add_mesh;
using test::place_mesh;

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
  std::size_t unfinished = 0;
};

class GpuLightTest : public test::OnGpu {
 protected:
  Lit light(const Scene& scene, const RaySettings& settings, const View& view, bool by_device,
            const SampleNumber& number = {3, 5}) {
    const Requirements requirements = requirements_of(scene);
    const RayScene rays(scene, RaySpace(scene), 2, covering_surfaces(scene, false));
    const FrameLayout layout({view.size()});
    TileLayer<Key> keys(layout);
    PrimaryRays(scene, rays, 2).draw(view, 0, std::array{Rect{0, 0, view.size().width, view.size().height}}, keys);
    EXPECT_EQ(refusal_of_light(scene, settings, plan_passes(requirements, settings)), "");
    MakeLightDevice make;
    if (by_device) {
      make = [&](const LightSources& sources) { return std::make_unique<GpuLight>(device(), sources, 2); };
    }
    DeferredShader shader(scene, settings, requirements, {}, nullptr, make);
    EXPECT_EQ(shader.lights_on_device(), by_device);
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
    for (const PassId pass : {PassId::Shadow, PassId::Reflection, PassId::Refraction, PassId::AmbientOcclusion}) {
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

TEST_F(GpuLightTest, IsThatOfTheCpu) {
  for (const char* const name : {"gen:cornell", "gen:gallery", "gen:sphereflake?s=2"}) {
    const Scene scene = load_scene(name);
    expect_as_cpu(scene, plain_settings(), view_of(scene, {96, 72}), name);
  }
}

}  // namespace
}  // namespace hpr
