#pragma once

#include <cstdint>

#include "image/key.h"
#include "rt/trace/ray_scene.h"
#include "scene/scene.h"
#include "scene/view.h"

namespace hpr {

/// A triangle's key where a ray meets it.
struct PlacedKey {
  Key key = kNoKey;         ///< kNoKey before the near plane and past the far one
  double along_axis = 0.0;  ///< metres from the eye along the view's axis
};

/// Of triangle `primitive` of a geometry of Embree's, for a ray of `view` known to meet it: in double, from the
/// triangle and the ray alone, so that whoever asks gets the same.
[[nodiscard]] PlacedKey key_along(const Scene& scene, const View& view, const Ray& ray, const RayGeometry& geometry,
                                  std::uint32_t primitive);

}  // namespace hpr
