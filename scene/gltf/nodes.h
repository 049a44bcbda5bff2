#pragma once

#include <glm/mat4x4.hpp>
#include <vector>

#include "scene/gltf/accessors.h"

namespace hpr {

/// Where the nodes stand.
struct GltfNodes {
  std::vector<glm::dmat4> to_world;  ///< of every node, also of those outside the scene
  std::vector<int> drawn;            ///< nodes of the active scene, parents first
};

/// Checks that nodes form trees (no node twice, no cycle) and composes their transforms in double; without recursion,
/// so that a chain may be as long as it likes. Throws Error (BadInput) also for projective matrices and transforms
/// that overflow.
[[nodiscard]] GltfNodes place_nodes(const GltfData& data);

/// A node's transforms by EXT_mesh_gpu_instancing, in its own coordinates; one identity without. Throws Error.
[[nodiscard]] std::vector<glm::dmat4> gpu_instances(const GltfData& data, int node);

}  // namespace hpr
