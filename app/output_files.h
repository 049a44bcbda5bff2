#pragma once

#include <span>
#include <string>
#include <string_view>

#include "scene/load_scene.h"

/// Where results go, and what they must not replace.
namespace hpr {

/// `text` to the file `path`, or to standard output where that is empty. Throws Error where the file is there and
/// `overwrite` is not said, or cannot be written.
void write_or_print(std::string_view text, const std::string& path, bool overwrite);

/// Throws Error (Usage) when two of these paths of results, or one and `trace`, are one file. Empty ones are none.
void check_distinct(std::span<const std::string> paths, const std::string& trace);

/// Throws Error (Usage) where a result would take the place of a file that is read: one of the scene's, or of `inputs`.
void check_spared(const std::string& scene, const SceneLimits& limits, std::span<const std::string> inputs,
                  std::span<const std::string> results);

}  // namespace hpr
