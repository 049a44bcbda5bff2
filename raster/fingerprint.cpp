#include <array>
#include <cstddef>
#include <cstdint>

#include "core/bytes.h"
#include "raster/rasterizer.h"

namespace hpr {
namespace {

/// In [-1, 1), the same on every machine: a 32-bit linear congruential generator (Numerical Recipes) and exact steps.
float next(std::uint32_t& state) {
  state = state * 1664525U + 1013904223U;
  return static_cast<float>(state >> 8U) / 8388608.0F - 1.0F;
}

/// 400 triangles from sub-pixel to larger than the screen, some through the near plane.
Scene fixed_scene() {
  Scene scene;
  Mesh& mesh = scene.meshes.emplace_back();
  std::uint32_t state = 1;
  for (std::uint32_t triangle = 0; triangle < 400; ++triangle) {
    const float scale = 4.0F / static_cast<float>(1U << (triangle % 10U));
    // Braces: the order of the three calls must not be the compiler's choice.
    const glm::vec3 center{next(state), next(state), next(state)};
    for (int corner = 0; corner < 3; ++corner) {
      mesh.positions.push_back(center + scale * glm::vec3{next(state), next(state), next(state)});
      mesh.normals.emplace_back(0.0F, 0.0F, 1.0F);
    }
    mesh.triangles.push_back(glm::uvec3(0U, 1U, 2U) + 3U * triangle);
  }
  scene.instances.push_back({});
  finish_scene(scene);
  return scene;
}

}  // namespace

std::uint64_t raster_fingerprint(GlContext& context) {
  const Scene scene = fixed_scene();
  View view;
  view.eye = {0.125, 0.25, 1.75};
  view.left = -0.75;
  view.right = 0.625;
  view.bottom = -0.5;
  view.top = 0.625;
  view.screen = {150, 130};
  view.block = {0, 0, 150, 130};
  TileLayer<Key> layer(FrameLayout({view.screen}));
  Rasterizer rasterizer(context, scene, std::array{SurfaceRange{0, scene.triangles}}, 1);
  rasterizer.draw(view, 0, std::array{view.block}, layer);
  const Image<Key> image = to_image(layer, 0);
  return xxh64(std::as_bytes(image.pixels()));
}

}  // namespace hpr
