#include "scene/load_scene.h"

#include <string_view>

#include "scene/generated.h"
#include "scene/gltf_loader.h"

namespace hpr {

Scene load_scene(const std::string& source, const SceneLimits& limits) {
  constexpr std::string_view kGenerated = "gen:";
  if (source.starts_with(kGenerated)) return generate_scene(std::string_view(source).substr(kGenerated.size()));
  return load_gltf(source, limits);
}

}  // namespace hpr
