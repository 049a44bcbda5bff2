#include "scene/scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "core/error.h"
#include "scene/boxes.h"

namespace hpr {
void finish_scene(Scene& scene) {
  if (scene.materials.empty()) scene.materials.emplace_back();
  constexpr std::uint64_t kMaxTriangles = std::numeric_limits<std::uint32_t>::max() - std::uint64_t{1};

  std::vector<Bounds> boxes;
  boxes.reserve(scene.meshes.size());
  for (const Mesh& mesh : scene.meshes) boxes.push_back(mesh_bounds(mesh));

  std::uint64_t triangles = 0;
  Bounds bounds = empty_bounds();
  for (Instance& instance : scene.instances) {
    HPR_CHECK(instance.mesh < scene.meshes.size());
    instance.first_surface = static_cast<std::uint32_t>(triangles);
    triangles += scene.mesh_of(instance).triangles.size();
    if (triangles > kMaxTriangles) {
      throw Error(ExitCode::Limit, fmt::format("the scene has more than {} triangles after instancing", kMaxTriangles),
                  "surface ids have 32 bits; draw fewer instances or a coarser level of detail");
    }
    if (scene.mesh_of(instance).triangles.empty()) continue;
    const Bounds box = transformed(instance.to_world, boxes[instance.mesh]);
    bounds = united(bounds, box);
  }
  scene.triangles = static_cast<std::uint32_t>(triangles);
  scene.bounds = triangles > 0 ? bounds : Bounds{};
}

SurfaceLocation locate_surface(const Scene& scene, std::uint32_t surface) {
  HPR_CHECK(surface < scene.triangles);
  // The last instance that starts at or before the id; empty instances before it start there too and are skipped.
  const auto after = std::ranges::upper_bound(scene.instances, surface, {}, &Instance::first_surface);
  const auto index = static_cast<std::uint32_t>(after - scene.instances.begin()) - 1;
  return {index, surface - scene.instances[index].first_surface};
}

glm::dvec3 world_position(const Instance& instance, const glm::vec3& position) {
  return {instance.to_world * glm::dvec4(position, 1.0)};
}

std::vector<glm::vec3> smooth_normals(const std::vector<glm::vec3>& positions,
                                      const std::vector<glm::uvec3>& triangles) {
  std::vector<glm::dvec3> sums(positions.size(), glm::dvec3(0.0));
  for (const glm::uvec3& t : triangles) {
    const glm::dvec3 v0(positions[t.x]);
    const glm::dvec3 normal = glm::cross(glm::dvec3(positions[t.y]) - v0, glm::dvec3(positions[t.z]) - v0);
    for (int corner = 0; corner < 3; ++corner) sums[t[corner]] += normal;
  }
  std::vector<glm::vec3> normals(positions.size());
  std::ranges::transform(sums, normals.begin(), [](const glm::dvec3& sum) {
    const double length = glm::length(sum);
    return length > 0.0 && std::isfinite(length) ? glm::vec3(sum / length) : glm::vec3(0.0F, 0.0F, 1.0F);
  });
  return normals;
}

}  // namespace hpr
