#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace hpr {

/// The files load_scene(source) reads: the scene's own, and the buffers and pictures that a glTF names. None of a
/// generated scene; what load_scene would refuse is left out.
[[nodiscard]] std::vector<std::filesystem::path> files_of_scene(const std::string& source);

}  // namespace hpr
