#include "scene/gltf/loader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "core/json.h"
#include "core/text.h"
#include "scene/gltf/accessors.h"
#include "scene/gltf/buffers.h"
#include "scene/gltf/item.h"
#include "scene/gltf/materials.h"
#include "scene/gltf/mesh.h"
#include "scene/gltf/nodes.h"
#include "scene/gltf/scan.h"
#include "scene/gltf/schema_check.h"

namespace hpr {
namespace {

/// tinygltf's model of the document, without its buffers and pictures: those are read by us alone, so that the library
/// never opens a file or decodes anything.
tinygltf::Model parse_model(Json root, const GltfContext& context) {
  root.erase("buffers");
  root.erase("images");
  // tinygltf refuses indices without a bufferView (zeros, or sparse ones); it does not get to see any.
  std::vector<int> indices;
  if (Json* const meshes = root.find("meshes")) {
    for (Json& mesh : meshes->elements()) {
      for (Json& primitive : mesh["primitives"].elements()) {
        indices.push_back(primitive.contains("indices") ? primitive["indices"].get<int>() : -1);
        primitive.erase("indices");
      }
    }
  }
  const std::string text = root.dump();
  if (text.size() > std::numeric_limits<unsigned int>::max()) {
    context.fail("", "the JSON has more than 4 GiB", "split the scene", ExitCode::Limit);
  }
  tinygltf::Model model;
  std::string errors;
  std::string warnings;
  if (!tinygltf::TinyGLTF().LoadASCIIFromString(&model, &errors, &warnings, text.data(),
                                                static_cast<unsigned int>(text.size()), "")) {
    context.fail("", printable(errors.substr(0, errors.find('\n')), 200));
  }
  std::size_t next = 0;
  for (tinygltf::Mesh& mesh : model.meshes) {
    for (tinygltf::Primitive& primitive : mesh.primitives) {
      if (next < indices.size()) primitive.indices = indices[next];
      ++next;
    }
  }
  if (next != indices.size()) context.fail("meshes", "some primitives cannot be read");
  return model;
}

/// The largest coordinate a mesh reaches in the world, or infinity.
double reach(const glm::dmat4& to_world, const glm::dvec3& largest) {
  double most = 0.0;
  for (int row = 0; row < 3; ++row) {
    const double sum = std::abs(to_world[0][row]) * largest.x + std::abs(to_world[1][row]) * largest.y +
                       std::abs(to_world[2][row]) * largest.z + std::abs(to_world[3][row]);
    most = std::max(most, std::isfinite(sum) ? sum : std::numeric_limits<double>::infinity());
  }
  return most;
}

glm::dvec3 largest_coordinates(const Mesh& mesh) {
  glm::dvec3 largest(0.0);
  for (const glm::vec3& p : mesh.positions) largest = glm::max(largest, glm::abs(glm::dvec3(p)));
  return largest;
}

/// Fills a scene from a checked document.
class SceneBuilder {
 public:
  SceneBuilder(const GltfData& data, Scene& scene) : data_(data), scene_(scene), nodes_(place_nodes(data)) {}

  void build() {
    default_material_ = static_cast<std::uint32_t>(scene_.materials.size());
    for (const int node : nodes_.drawn) add_node(node);
    const bool needs_default =
        std::ranges::any_of(scene_.meshes, [&](const Mesh& mesh) { return mesh.material == default_material_; });
    if (needs_default) scene_.materials.emplace_back().name = "default";
    if (singular_ > 0) context().warn("", fmt::format("{} nodes have a singular matrix", singular_));
    if (scene_.instances.empty()) context().warn("", "the scene has nothing to draw");
  }

 private:
  /// Which meshes come of a glTF mesh in one pose: (mesh, skin, weights).
  using PoseKey = std::tuple<int, int, std::vector<double>>;

  [[nodiscard]] GltfContext& context() const { return data_.context(); }

  void add_node(int node) {
    const tinygltf::Node& from = data_.model().nodes[GltfData::to_size(node)];
    const glm::dmat4& to_world = nodes_.to_world[GltfData::to_size(node)];
    if (auto light = light_of(data_, node, to_world)) scene_.lights.push_back(*std::move(light));
    if (auto camera = camera_of(data_, node, to_world)) {
      if (camera->name.empty()) camera->name = fmt::format("camera{}", scene_.cameras.size());
      scene_.cameras.push_back(*std::move(camera));
    }
    if (from.mesh < 0) {
      if (from.skin >= 0) context().warn(fmt::format("nodes[{}]", node), "has a skin but no mesh");
      return;
    }
    const std::vector<std::uint32_t>& meshes = meshes_of(from);
    if (from.skin >= 0) {
      // Skinned vertices are in the world already (glTF 2.0, section 3.7.3.3).
      add_instances(node, meshes, glm::dmat4(1.0), {glm::dmat4(1.0)});
    } else {
      add_instances(node, meshes, to_world, gpu_instances(data_, node));
    }
  }

  void add_instances(int node, const std::vector<std::uint32_t>& meshes, const glm::dmat4& to_world,
                     const std::vector<glm::dmat4>& copies) {
    context().charge(copies.size() * meshes.size() * sizeof(Instance), "instances");
    for (const std::uint32_t mesh : meshes) {
      for (const glm::dmat4& copy : copies) {
        Instance instance{mesh, to_world * copy, 0};
        // Squares of coordinates must stay finite in single precision, and ray tracers refuse more than 1.8e19.
        constexpr double kMaxCoordinate = 1e18;
        if (reach(instance.to_world, largest_[mesh]) > kMaxCoordinate) {
          context().warn(fmt::format("nodes[{}]", node), "reaches beyond 1e18 metres and is left out");
          continue;
        }
        if (glm::determinant(glm::dmat3(instance.to_world)) == 0.0) ++singular_;
        scene_.instances.push_back(instance);
        scene_.node_names.push_back(node_name(node));
      }
    }
  }

  [[nodiscard]] std::string node_name(int node) const {
    const std::string& name = data_.model().nodes[GltfData::to_size(node)].name;
    return name.empty() ? fmt::format("node{}", node) : name;
  }

  const std::vector<std::uint32_t>& meshes_of(const tinygltf::Node& node) {
    const tinygltf::Mesh& from = data_.model().meshes[GltfData::to_size(node.mesh)];
    const bool own_weights = !node.weights.empty();
    PoseKey key{node.mesh, node.skin, own_weights ? node.weights : from.weights};
    const auto known = meshes_.find(key);
    if (known != meshes_.end()) return known->second;

    const GltfPose pose{own_weights ? node.weights : from.weights, joints_of(node.skin)};
    std::vector<std::uint32_t> made;
    for (std::size_t p = 0; p < from.primitives.size(); ++p) {
      const std::string where = fmt::format("meshes[{}].primitives[{}]", node.mesh, p);
      auto mesh = build_primitive(data_, from.primitives[p], where, pose, default_material_);
      if (!mesh) continue;
      check_texture_coordinates(*mesh, where);
      mesh->name = from.primitives.size() > 1 ? fmt::format("{}.{}", from.name, p) : from.name;
      made.push_back(static_cast<std::uint32_t>(scene_.meshes.size()));
      largest_.push_back(largest_coordinates(*mesh));
      scene_.meshes.push_back(*std::move(mesh));
    }
    return meshes_.emplace(std::move(key), std::move(made)).first->second;
  }

  /// Every joint's way from the mesh to the world.
  [[nodiscard]] std::vector<glm::dmat4> joints_of(int skin) const {
    if (skin < 0) return {};
    const tinygltf::Skin& from = data_.model().skins[GltfData::to_size(skin)];
    std::vector<glm::dmat4> joints;
    joints.reserve(from.joints.size());
    for (const int joint : from.joints) joints.push_back(nodes_.to_world[GltfData::to_size(joint)]);
    if (from.inverseBindMatrices < 0) return joints;
    const auto inverse = data_.mat4s(from.inverseBindMatrices);
    for (std::size_t i = 0; i < std::min(joints.size(), inverse.size()); ++i) joints[i] *= glm::dmat4(inverse[i]);
    return joints;
  }

  void check_texture_coordinates(const Mesh& mesh, const std::string& where) const {
    if (mesh.material >= scene_.materials.size()) return;
    const Material& material = scene_.materials[mesh.material];
    for (const TextureRef* ref :
         {&material.base_color_texture, &material.metallic_roughness_texture, &material.emissive_texture,
          &material.normal_texture, &material.occlusion_texture, &material.transmission_texture}) {
      if (ref->present() && mesh.uvs[ref->uv_set].empty()) {
        context().warn(where, fmt::format("has no TEXCOORD_{} for the texture of its material", ref->uv_set));
      }
    }
  }

  const GltfData& data_;
  Scene& scene_;
  GltfNodes nodes_;
  std::map<PoseKey, std::vector<std::uint32_t>> meshes_;
  std::vector<glm::dvec3> largest_;  ///< per mesh of the scene
  std::uint32_t default_material_ = 0;
  std::size_t singular_ = 0;
};

void check_skins(const GltfData& data) {
  const auto& skins = data.model().skins;
  for (std::size_t i = 0; i < skins.size(); ++i) {
    const int matrices = skins[i].inverseBindMatrices;
    if (matrices < 0) continue;
    const std::string where = fmt::format("skins[{}].inverseBindMatrices", i);
    data.require_type(matrices, {TINYGLTF_TYPE_MAT4}, where);
    if (data.accessor(matrices).componentType != TINYGLTF_COMPONENT_TYPE_FLOAT) {
      data.context().fail(where, "must be floats");
    }
    if (data.count(matrices) < skins[i].joints.size()) {
      data.context().fail(where,
                          fmt::format("{} matrices for {} joints", data.count(matrices), skins[i].joints.size()));
    }
  }
}

}  // namespace

Scene load_gltf(const std::filesystem::path& path, const SceneLimits& limits) {
  GltfContext context(path.string(), limits);
  const GltfFile file = open_gltf(path, context);
  Json root = parse_json(file.parts.json, context);
  if (!root.is_object()) context.fail("", "this is no glTF: the JSON is not an object");
  check_extensions(root, context);
  check_shape(root, context);

  GltfBuffers buffers(path.parent_path(), file.parts);
  buffers.load(root, context);
  const Json images = root.contains("images") ? std::move(root["images"]) : Json();
  const tinygltf::Model model = parse_model(std::move(root), context);
  const GltfData data(model, buffers, context);
  check_meshes(data);
  check_skins(data);

  Scene scene;
  scene.name = path.stem().string();
  GltfMaterials(data, buffers, images).build(scene);
  SceneBuilder(data, scene).build();
  scene.warnings = context.take_warnings();
  scene.not_finite = context.not_finite();
  finish_scene(scene);
  return scene;
}

}  // namespace hpr
