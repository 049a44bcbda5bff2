#pragma once

#include <string>

#include "app/options/globals.h"
#include "tools/compare/compare.h"

namespace hpr {

/// What `hpr compare SCENE` composites: each rank's share of the scene's objects (sort-last), drawn over a wall of
/// `grid` screens of `screen` pixels; with `local_shading` each rank lights its own, once per pixel and as render does
/// where nothing else is said, and the keys carry colours.
[[nodiscard]] CompareInput scene_layers(const std::string& scene, Size screen, Size grid, bool local_shading,
                                        const Globals& globals);

}  // namespace hpr
