#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "image/tiles.h"
#include "rt/ray_scene.h"
#include "scene/scene.h"
#include "scene/view.h"

namespace hpr {

/// Per mesh, what its vertices fill, in its own coordinates.
[[nodiscard]] std::vector<Bounds> mesh_boxes(const Scene& scene);

/// Per tile of a screen, 1 where a ray of `view` may meet a surface that `rays` holds, by the boxes of its instances:
/// most pictures have tiles of mere background. Allows for what rounding may do to rays. `boxes`: mesh_boxes(scene).
[[nodiscard]] std::vector<std::uint8_t> occupied_tiles(const Scene& scene, const RayScene& rays,
                                                       std::span<const Bounds> boxes, const View& view,
                                                       const FrameLayout& layout, std::size_t screen);

}  // namespace hpr
