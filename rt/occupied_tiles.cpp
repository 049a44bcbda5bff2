#include "rt/occupied_tiles.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec4.hpp>
#include <limits>

#include "scene/boxes.h"

namespace hpr {
namespace {

/// By how much rounding may move what a ray meets, generously, in ray space: places are below 8 there, and instances
/// enlarge errors at most sixteen times (ray_scene.cpp).
constexpr double kRounding = 1.0 / 16384.0;
/// Past this many instances looking at each costs more than rays that miss.
constexpr std::size_t kMostBoxes = 200'000;

/// The pixels a box of the world may be seen in; the whole view where it reaches behind the near plane. Not of views
/// whose pixels look through points of their own.
Rect pixels_of(const View& view, const glm::dmat4& clip, const Bounds& box) {
  const Size size = view.size();
  const Rect all{0, 0, size.width, size.height};
  glm::dvec2 low(std::numeric_limits<double>::infinity());
  glm::dvec2 high(-std::numeric_limits<double>::infinity());
  for (unsigned int corner = 0; corner < 8; ++corner) {
    const glm::dvec3 place((corner & 1U) != 0 ? box.high.x : box.low.x, (corner & 2U) != 0 ? box.high.y : box.low.y,
                           (corner & 4U) != 0 ? box.high.z : box.low.z);
    const glm::dvec4 at = clip * glm::dvec4(place - view.eye, 1.0);
    if (!(at.w > 0.0) || !(at.w >= 0.5 * view.near_distance || view.orthographic)) return all;
    const glm::dvec2 pixel((0.5 + 0.5 * at.x / at.w) * size.width, (0.5 - 0.5 * at.y / at.w) * size.height);
    low = glm::min(low, pixel);
    high = glm::max(high, pixel);
  }
  if (!std::isfinite(low.x + low.y + high.x + high.y)) return all;
  const auto within = [](double value, int limit) {
    return static_cast<int>(std::clamp(value, 0.0, static_cast<double>(limit)));
  };
  return {within(low.x - 1.0, size.width), within(low.y - 1.0, size.height), within(high.x + 2.0, size.width),
          within(high.y + 2.0, size.height)};
}

}  // namespace

std::vector<Bounds> mesh_boxes(const Scene& scene) {
  std::vector<Bounds> boxes;
  for (const Mesh& mesh : scene.meshes) {
    boxes.push_back(mesh.triangles.empty() ? Bounds{} : mesh_bounds(mesh));
  }
  return boxes;
}

std::vector<std::uint8_t> occupied_tiles(const Scene& scene, const RayScene& rays, std::span<const Bounds> boxes,
                                         const View& view, const FrameLayout& layout, std::size_t screen) {
  const TileRun run = layout.tiles_of(screen);
  const bool many = view.points || rays.geometries().size() > kMostBoxes;
  std::vector<std::uint8_t> occupied(run.count, many ? 1 : 0);
  if (many) return occupied;
  const glm::dmat4 clip = clip_from_world(view, view.eye);
  const glm::dvec3 margin(kRounding / rays.space().scale);
  for (const RayGeometry& geometry : rays.geometries()) {
    const Instance& instance = scene.instances[geometry.instance];
    const Bounds world = transformed(instance.to_world, boxes[instance.mesh]);
    const Rect pixels = pixels_of(view, clip, {world.low - margin, world.high + margin});
    for (int y = pixels.y0 / kTileSide * kTileSide; y < pixels.y1; y += kTileSide) {
      for (int x = pixels.x0 / kTileSide * kTileSide; x < pixels.x1; x += kTileSide) {
        occupied[layout.tile_at(screen, x, y) - run.first] = 1;
      }
    }
  }
  return occupied;
}

}  // namespace hpr
