#pragma once

#include <string>

#include "app/command.h"
#include "app/compare.h"

namespace hpr {

/// What `hpr compare SCENE` composites: each rank's share of the scene's objects (sort-last), drawn over a wall of
/// `grid` screens of `screen` pixels.
[[nodiscard]] CompareInput scene_layers(const std::string& scene, Size screen, Size grid, const Globals& globals);

}  // namespace hpr
