#pragma once

#include <cstdint>
#include <glm/mat4x4.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "scene/gltf/accessors.h"
#include "scene/scene.h"

namespace hpr {

/// How a mesh stands: what its node adds to it.
struct GltfPose {
  std::vector<double> weights;     ///< of the morph targets; missing ones are 0
  std::vector<glm::dmat4> joints;  ///< mesh -> world per joint of the skin; empty: no skin
};

/// Checks types, counts and names of the attributes, indices and morph targets of every mesh. Reads no vertex. Throws
/// Error (BadInput) for one that is used.
void check_meshes(const GltfData& data);

/// One primitive as triangles: strips and fans taken apart, morphed and skinned as `pose` says, with flat normals on
/// vertices of their own where the file has none (as glTF wants it). Points and lines become a mesh of their kind.
/// None, with a warning, for primitives without positions. `default_material` stands in where the primitive names none.
/// Throws Error (BadInput, Limit).
[[nodiscard]] std::optional<Mesh> build_primitive(const GltfData& data, const tinygltf::Primitive& primitive,
                                                  const std::string& where, const GltfPose& pose,
                                                  std::uint32_t default_material);

/// Whether positions leave the box that their accessor declares. Boxes of integers are not looked at.
[[nodiscard]] bool leaves_declared_bounds(const tinygltf::Accessor& positions, const glm::vec3& low,
                                          const glm::vec3& high);

/// The triangles of `count` vertices (or of `indices`, when there are any) in a TINYGLTF_MODE_*; left-over vertices of
/// lists are dropped.
[[nodiscard]] std::vector<glm::uvec3> triangles_of(int mode, std::size_t count, std::span<const std::uint32_t> indices);

/// Points (i, i, i) or segments (i, j, j) of `count` vertices (or of `indices`, when there are any) in a
/// TINYGLTF_MODE_*; a left-over vertex of a list of lines is dropped.
[[nodiscard]] std::vector<glm::uvec3> points_or_lines_of(int mode, std::size_t count,
                                                         std::span<const std::uint32_t> indices);

}  // namespace hpr
