#pragma once

#include <functional>
#include <memory>
#include <string>

#include "app/command.h"
#include "app/compare.h"

namespace hpr {

/// What `hpr compare SCENE` composites, for a wall of `grid` screens of `screen` pixels: made by whoever can draw. With
/// `local_shading` its keys carry colours.
using SceneInput = std::function<CompareInput(const std::string& scene, Size screen, Size grid, bool local_shading,
                                              const Globals& globals)>;

/// `hpr compare`. Without `scene_input` it knows synthetic layers only and declares no SCENE.
[[nodiscard]] std::unique_ptr<Command> make_compare_command(SceneInput scene_input = nullptr);

}  // namespace hpr
