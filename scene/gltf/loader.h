#pragma once

#include <filesystem>

#include "scene/load_scene.h"

namespace hpr {

/// A glTF 2.0 file (text or binary, known by its first bytes). Trusts nothing in it: every index, range, stride and
/// count is checked in 64 bits, URIs may only name files below the file's own folder, JSON deeper than 64 levels is
/// refused. What is wrong but harmless becomes a warning in Scene::warnings. Throws Error (Io, BadInput, Limit).
[[nodiscard]] Scene load_gltf(const std::filesystem::path& path, const SceneLimits& limits);

}  // namespace hpr
