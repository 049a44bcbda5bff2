#include "scene/load_scene.h"

#include <fmt/format.h>

#include <string_view>

#include "core/error.h"
#include "scene/generators/generated.h"
#include "scene/gltf/loader.h"

namespace hpr {
namespace {

/// What a scene's arrays take.
std::uint64_t memory_of(const Scene& scene) {
  std::uint64_t bytes = scene.instances.size() * sizeof(Instance);
  for (const Mesh& mesh : scene.meshes) {
    bytes += mesh.positions.size() * sizeof(glm::vec3) + mesh.normals.size() * sizeof(glm::vec3);
    bytes += (mesh.colors.size() + mesh.tangents.size()) * sizeof(glm::vec4);
    bytes += (mesh.uvs[0].size() + mesh.uvs[1].size()) * sizeof(glm::vec2) + mesh.triangles.size() * sizeof(glm::uvec3);
  }
  for (const Texture& texture : scene.textures) bytes += texture.image.pixels().size_bytes();
  return bytes;
}

}  // namespace

Scene load_scene(const std::string& source, const SceneLimits& limits) {
  constexpr std::string_view kGenerated = "gen:";
  if (source.starts_with(kGenerated)) {
    Scene scene = generate_scene(std::string_view(source).substr(kGenerated.size()));
    if (const std::uint64_t bytes = memory_of(scene); bytes > limits.memory_bytes) {
      throw Error(ExitCode::Limit,
                  fmt::format("{}: needs {} bytes, more than the limit of {}", source, bytes, limits.memory_bytes),
                  "choose a smaller scene, or raise --limit-mem");
    }
    return scene;
  }
  return load_gltf(source, limits);
}

}  // namespace hpr
