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
  Requirement photon;
};

[[nodiscard]] Requirements requirements_of(const Scene& scene);

/// A surface mirrors visibly below this roughness; above it the reflection pass leaves it alone.
inline constexpr float kMirrorRoughness = 0.3F;

}  // namespace hpr
