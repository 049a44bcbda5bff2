#pragma once

#include <fmt/format.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <string>

#include "scene/scene.h"

namespace hpr::test {

/// What breaks the promises of a Mesh, or nothing.
[[nodiscard]] inline std::string first_flaw(const Mesh& mesh) {
  if (mesh.normals.size() != mesh.positions.size()) return "normals and positions differ in number";
  for (const auto& uv : mesh.uvs) {
    if (!uv.empty() && uv.size() != mesh.positions.size()) return "texture coordinates and positions differ in number";
  }
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      if (!std::isfinite(mesh.positions[i][axis])) return fmt::format("position {} is not finite", i);
    }
    if (!(std::abs(glm::length(glm::dvec3(mesh.normals[i])) - 1.0) < 1e-6)) {
      return fmt::format("normal {} is not of unit length", i);
    }
  }
  for (const glm::uvec3& t : mesh.triangles) {
    for (int corner = 0; corner < 3; ++corner) {
      if (t[corner] >= mesh.positions.size()) return "a triangle names a vertex that does not exist";
    }
    const glm::dvec3 a(mesh.positions[t.x]);
    const glm::dvec3 cross = glm::cross(glm::dvec3(mesh.positions[t.y]) - a, glm::dvec3(mesh.positions[t.z]) - a);
    const glm::dvec3 normals =
        glm::dvec3(mesh.normals[t.x]) + glm::dvec3(mesh.normals[t.y]) + glm::dvec3(mesh.normals[t.z]);
    if (!(glm::dot(cross, normals) > 0.0)) return "a triangle winds against its normals, or has no area";
  }
  return {};
}

}  // namespace hpr::test
