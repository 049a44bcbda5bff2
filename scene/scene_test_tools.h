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

/// Extensions of which no value is the default.
inline MaterialExtensions full_extensions() {
  MaterialExtensions extensions;
  extensions.specular = 0.9F;
  extensions.specular_color = {0.1F, 2.0F, 0.3F};
  extensions.clearcoat = 0.8F;
  extensions.clearcoat_roughness = 0.7F;
  extensions.clearcoat_normal_scale = -0.5F;
  extensions.sheen_color = {0.2F, 0.3F, 0.4F};
  extensions.sheen_roughness = 0.6F;
  extensions.anisotropy = 0.5F;
  extensions.anisotropy_rotation_radians = 1.5F;
  extensions.iridescence = 0.4F;
  extensions.iridescence_ior = 1.6F;
  extensions.iridescence_min_nm = 50.0F;
  extensions.iridescence_max_nm = 700.0F;
  extensions.dispersion = 0.3F;
  extensions.diffuse_transmission = 0.2F;
  extensions.diffuse_transmission_color = {0.5F, 0.6F, 0.7F};
  // Each with coordinates of its own.
  std::uint32_t number = 0;
  for (const TextureRef* texture : extensions.textures()) {
    ++number;
    const_cast<TextureRef&>(*texture) = {
        0, number % 2, {1.0F, 0.0F, 0.0F, 1.0F, 0.0F, 0.25F * static_cast<float>(number)}};
  }
  return extensions;
}

}  // namespace hpr::test
