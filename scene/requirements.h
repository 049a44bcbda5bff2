#pragma once

#include <string>

#include "scene/scene.h"

namespace hpr {

struct Requirement {
  bool needed = false;
  std::string why;  ///< one clause: "2 lights cast shadows", "no material is smooth enough to mirror"
};

/// Which ray passes a scene can show at all, from its lights and materials ("model only what a scene requires").
struct Requirements {
  Requirement shadow;
  Requirement reflection;
  Requirement refraction;
  Requirement photon;                 ///< caustics: light that smooth surfaces bundle
  Requirement indirect;               ///< light that rough surfaces scatter on to others
  Requirement ambient_occlusion;      ///< a cheap stand-in for that
  float min_roughness = 1.0F;         ///< of any visible lit material that reflects, anywhere
  float max_roughness = 0.0F;         ///< of the same materials
  bool constant_environment = false;  ///< whether all light comes from an environment of one radiance
  bool even_environment = false;      ///< or from one that has no small bright lights, but for faint emitters
};

[[nodiscard]] Requirements requirements_of(const Scene& scene);

/// Whether a material sends out light anywhere: a textured one does where a texel isn't black.
[[nodiscard]] bool emits(const Scene& scene, const Material& material);

/// Whether the scene has any light of its own: punctual lights, visible surfaces that emit, an environment; one that is
/// black too, as that asks for darkness. A scene without gets a headlight.
[[nodiscard]] bool gives_light(const Scene& scene);

/// A surface mirrors visibly below this roughness; above it the reflection pass leaves it alone.
inline constexpr float kMirrorRoughness = 0.3F;

}  // namespace hpr
