#pragma once

#include "scene/scene.h"

namespace hpr {

/// The scene with a mesh of its own, in world coordinates, for every instance: as programs export that know no
/// instances. Positions are rounded to floats in the world. Points and lines keep their places. Finished. Throws Error
/// (Limit) as finish_scene does.
[[nodiscard]] Scene flattened(const Scene& scene);

}  // namespace hpr
