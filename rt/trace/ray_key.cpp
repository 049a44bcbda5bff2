#include "rt/trace/ray_key.h"

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>

#include "rt/trace/on_triangle.h"

namespace hpr {

PlacedKey key_along(const Scene& scene, const View& view, const Ray& ray, const RayGeometry& geometry,
                    std::uint32_t primitive) {
  const Instance& instance = scene.instances[geometry.instance];
  const Mesh& mesh = scene.mesh_of(instance);
  const glm::uvec3& corners = mesh.triangles[geometry.first_triangle + primitive];
  // Edges as differences of the mesh's own coordinates, and all of it relative to the eye: far places cost no digits.
  const glm::dmat3 linear(instance.to_world);
  const glm::dvec3 p0(mesh.positions[corners.x]);
  const glm::dvec3 e1 = linear * (glm::dvec3(mesh.positions[corners.y]) - p0);
  const glm::dvec3 e2 = linear * (glm::dvec3(mesh.positions[corners.z]) - p0);
  const glm::dvec3 v0 = linear * p0 + (glm::dvec3(instance.to_world[3]) - view.eye);

  // Moeller and Trumbore 1997, from the ray's origin.
  const glm::dvec3 from_v0 = (ray.origin - view.eye) - v0;
  const glm::dvec3 p = glm::cross(ray.direction, e2);
  const glm::dvec3 q = glm::cross(from_v0, e1);
  const double determinant = glm::dot(e1, p);
  const glm::dvec2 at = onto_triangle(glm::dot(from_v0, p) / determinant, glm::dot(ray.direction, q) / determinant);
  const double along_axis = -glm::dot(v0 + at.x * e1 + at.y * e2, view.axes[2]);

  const auto depth = static_cast<float>(reversed_depth(view, along_axis));
  if (!(depth > 0.0F) || !(depth <= 1.0F)) return {kNoKey, along_axis};
  return {make_key(depth, geometry.first_surface + primitive), along_axis};
}

}  // namespace hpr
