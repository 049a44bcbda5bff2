#include "scene/flatten.h"

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <utility>

namespace hpr {
namespace {

glm::vec3 unit_or(const glm::dvec3& v, const glm::vec3& otherwise) {
  const double length = glm::length(v);
  return length > 0.0 ? glm::vec3(v / length) : otherwise;
}

Mesh in_world(const Mesh& mesh, const Instance& instance) {
  Mesh placed = mesh;
  const glm::dmat3 linear(instance.to_world);
  const bool mirrors = is_mirrored(instance);
  // Cofactors: the inverse transpose but for its size and its sign.
  const glm::dmat3 cofactors{glm::cross(linear[1], linear[2]), glm::cross(linear[2], linear[0]),
                             glm::cross(linear[0], linear[1])};
  const double sign = mirrors ? -1.0 : 1.0;
  for (glm::vec3& position : placed.positions) position = glm::vec3(world_position(instance, position));
  for (glm::vec3& normal : placed.normals) normal = unit_or(sign * (cofactors * glm::dvec3(normal)), normal);
  for (glm::vec4& tangent : placed.tangents) {
    const glm::vec3 along = unit_or(linear * glm::dvec3(tangent), glm::vec3(0.0F));
    tangent = glm::vec4(along, mirrors ? -tangent.w : tangent.w);
  }
  if (mirrors && mesh.kind == MeshKind::Triangles) {
    for (glm::uvec3& triangle : placed.triangles) std::swap(triangle.y, triangle.z);
  }
  return placed;
}

}  // namespace

Scene flattened(const Scene& scene) {
  Scene flat = scene;
  flat.meshes.clear();
  for (Instance& instance : flat.instances) {
    flat.meshes.push_back(in_world(scene.mesh_of(instance), instance));
    instance.mesh = static_cast<std::uint32_t>(flat.meshes.size() - 1);
    instance.to_world = glm::dmat4(1.0);
  }
  finish_scene(flat);
  return flat;
}

}  // namespace hpr
