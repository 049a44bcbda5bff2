#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "image/image_io.h"
#include "scene/scene.h"

namespace hpr {

/// What a scene may cost before it is refused (ExitCode::Limit).
struct SceneLimits {
  std::uint64_t file_bytes = std::uint64_t{4} << 30U;
  std::uint64_t memory_bytes = std::uint64_t{16} << 30U;  ///< of the loaded scene, estimated before it is allocated
  ImageLimits image;
};

/// Loads what the command line calls SCENE: a .gltf or .glb file, or `gen:NAME?key=value&key=value`. The result is
/// finished (finish_scene) and may be drawn as it is. Throws Error (Io, BadInput, Limit, Usage).
[[nodiscard]] Scene load_scene(const std::string& source, const SceneLimits& limits = {});

}  // namespace hpr
