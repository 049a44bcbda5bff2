#pragma once

#include <cstddef>
#include <glm/mat4x4.hpp>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "core/json.h"
#include "scene/gltf/accessors.h"
#include "scene/picture_source.h"
#include "scene/scene.h"

namespace hpr {

/// Turns a document's materials into ours and decodes the pictures they refer to, each once. A picture that is missing
/// or broken is left out with a warning; one past the limits is an error.
class GltfMaterials {
 public:
  /// `images` is the document's section of that name (or null): tinygltf never sees pictures.
  GltfMaterials(const GltfData& data, const GltfBuffers& buffers, const Json& images)
      : data_(data), buffers_(buffers), images_(images) {}

  /// Fills scene.materials, one per material of the document, and scene.textures. Where meshes are read one by one,
  /// texels of pictures that lie in files are left out, but of those that give light.
  void build(Scene& scene);

  /// Of each texture where its texels lie, if they were left out, else null.
  [[nodiscard]] std::vector<std::shared_ptr<const PictureSource>> take_sources() { return std::move(sources_); }

 private:
  using SamplerKey = std::tuple<int, Wrap, Wrap, bool>;

  [[nodiscard]] Material material(const tinygltf::Material& from, const std::string& where, Scene& scene);
  void add_detail(const tinygltf::Material& from, const std::string& where, Scene& scene, Material& to);
  void add_extensions(const tinygltf::Material& from, const std::string& where, Scene& scene, Material& to);
  void add_coats(const tinygltf::Material& from, const std::string& where, Scene& scene, MaterialExtensions& to);
  void add_specular_extensions(const tinygltf::Material& from, const std::string& where, Scene& scene,
                               MaterialExtensions& to);
  [[nodiscard]] TextureRef texture_in(const tinygltf::Value& object, const char* key, const std::string& where,
                                      Scene& scene);
  /// The three kinds of texture info differ in what they say beside these.
  [[nodiscard]] TextureRef texture_ref(int index, int uv_set, const tinygltf::ExtensionMap& extensions,
                                       const std::string& where, Scene& scene);
  template <typename Info>
  [[nodiscard]] TextureRef texture_ref(const Info& info, const std::string& where, Scene& scene) {
    return texture_ref(info.index, info.texCoord, info.extensions, where, scene);
  }
  [[nodiscard]] std::int32_t texture(int index, const std::string& where, Scene& scene);
  /// Texels, or what is known of them and where they lie.
  struct Picture {
    Texels texels;
    std::shared_ptr<const PictureSource> source;
  };
  [[nodiscard]] std::optional<Picture> picture(int image);
  [[nodiscard]] Picture decoded(int image, std::span<const std::byte> bytes,
                                const std::optional<FileLocation>& location);
  void find_emissive();

  const GltfData& data_;
  const GltfBuffers& buffers_;
  const Json& images_;
  std::map<SamplerKey, std::int32_t> textures_;
  std::vector<std::shared_ptr<const PictureSource>> sources_;
  std::vector<bool> emissive_;            ///< images that give light
  std::map<int, std::int32_t> pictures_;  ///< image -> first texture that holds it, -1: cannot be drawn
};

/// A node's KHR_lights_punctual light, placed in the world; none when it has none.
[[nodiscard]] std::optional<Light> light_of(const GltfData& data, int node, const glm::dmat4& to_world);

/// A node's camera, placed in the world; its axes are made orthonormal, because scale has no meaning for cameras.
[[nodiscard]] std::optional<Camera> camera_of(const GltfData& data, int node, const glm::dmat4& to_world);

}  // namespace hpr
