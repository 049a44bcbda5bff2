#pragma once

#include <glm/vec3.hpp>

#include "rt/deferred_shader.h"
#include "scene/scene.h"
#include "scene/view.h"

/// One small scene with something of everything light does, to be moved and scaled.
namespace hpr::stability {

/// On a floor of 6 m: a matte sphere, a mirror, a ball of tinted glass and a box, lit by a small lamp, the sun and a
/// glowing panel. What is placed lies at multiples of 1 / `steps_per_metre`, if that is not 0.
[[nodiscard]] Scene exhibits(double steps_per_metre = 0.0);
/// Its picture, 256 x 192 pixels; places as above.
[[nodiscard]] View exhibits_view(double steps_per_metre = 0.0);
/// All passes, and photons.
[[nodiscard]] RaySettings exhibits_light();

/// The scene as it looks from `view` enlarged by `factor` about the world's origin, in its placements.
void scale_placements(Scene& scene, double factor);
/// The same, in its vertices: exact where `factor` is a power of two.
void scale_vertices(Scene& scene, double factor);
void scale_view(View& view, double factor);

/// The scene moved by `offset`, in its placements.
void move_placements(Scene& scene, const glm::dvec3& offset);
/// The same, in its vertices, which then are world coordinates in floats.
void move_vertices(Scene& scene, const glm::dvec3& offset);

}  // namespace hpr::stability
