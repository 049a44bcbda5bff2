#pragma once

#include <cstddef>
#include <vector>

#include "scene/scene.h"

namespace hpr {

/// The scene as a binary glTF 2.0 file: meshes, materials, textures (PNG), instances, punctual lights, cameras. Loading
/// it again gives the same triangles, bit by bit. The background and headlights have no place in glTF and are left out.
[[nodiscard]] std::vector<std::byte> encode_glb(const Scene& scene);

}  // namespace hpr
