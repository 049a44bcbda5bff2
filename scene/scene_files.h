#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "scene/load_scene.h"

namespace hpr {

/// The files load_scene(source, limits) may read: the scene's own, and the buffers and pictures that a glTF names. None
/// of a generated scene; of a file that load_scene would refuse just that file.
[[nodiscard]] std::vector<std::filesystem::path> files_of_scene(const std::string& source,
                                                                const SceneLimits& limits = {});

}  // namespace hpr
