#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "core/json.h"
#include "core/text.h"
#include "scene/gltf/accessors.h"
#include "scene/gltf/compression.h"
#include "scene/gltf/document.h"
#include "scene/gltf/gltf.h"
#include "scene/gltf/materials.h"
#include "scene/gltf/mesh.h"
#include "scene/gltf/pieces/primitive_reader.h"
#include "scene/gltf/scan.h"
#include "scene/gltf/selection.h"
#include "scene/gltf/uri.h"

namespace hpr {
namespace {

/// Where the nodes stand.
struct GltfNodes {
  std::vector<glm::dmat4> to_world;  ///< of every node, also of those outside the scene
  std::vector<bool> hidden;          ///< of every node: KHR_node_visibility, its own or an ancestor's
  std::vector<int> drawn;            ///< nodes of the active scene, parents first
};

std::string node_path(std::size_t node) {
  return fmt::format("nodes[{}]", node);
}

bool all_finite(const glm::dmat4& matrix) {
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) {
      if (!std::isfinite(matrix[column][row])) return false;
    }
  }
  return true;
}

glm::dmat4 from_parts(const glm::dvec3& translation, const glm::dquat& rotation, const glm::dvec3& scale) {
  const glm::dmat3 turn = glm::mat3_cast(rotation);
  return {glm::dvec4(turn[0] * scale.x, 0.0), glm::dvec4(turn[1] * scale.y, 0.0), glm::dvec4(turn[2] * scale.z, 0.0),
          glm::dvec4(translation, 1.0)};
}

/// A unit quaternion from x, y, z, w; the identity, with a warning, when it has no direction.
glm::dquat unit_rotation(double x, double y, double z, double w, const std::string& where, GltfContext& context) {
  const double length = std::hypot(std::hypot(x, y), std::hypot(z, w));
  if (!(length > 0.0) || !std::isfinite(length)) {
    context.warn(where, "the rotation is no quaternion; taken as none");
    return {1.0, 0.0, 0.0, 0.0};
  }
  if (std::abs(length - 1.0) > 0.01) context.warn(where, "the rotation is no unit quaternion");
  return {w / length, x / length, y / length, z / length};
}

glm::dmat4 local_matrix(const tinygltf::Node& node, const std::string& where, GltfContext& context) {
  if (node.matrix.size() == 16) {
    glm::dmat4 matrix;
    for (int i = 0; i < 16; ++i) matrix[i / 4][i % 4] = node.matrix[static_cast<std::size_t>(i)];
    constexpr double kSlack = 1e-6;
    for (int column = 0; column < 4; ++column) {
      const double expected = column == 3 ? 1.0 : 0.0;
      if (std::abs(matrix[column][3] - expected) > kSlack) {
        context.fail(where + ".matrix", "must be affine: its last row is not 0 0 0 1");
      }
      matrix[column][3] = expected;
    }
    return matrix;
  }
  const auto vector = [](const std::vector<double>& values, double fallback) {
    return values.size() == 3 ? glm::dvec3(values[0], values[1], values[2]) : glm::dvec3(fallback);
  };
  glm::dquat rotation(1.0, 0.0, 0.0, 0.0);
  if (const auto& r = node.rotation; r.size() == 4) rotation = unit_rotation(r[0], r[1], r[2], r[3], where, context);
  return from_parts(vector(node.translation, 0.0), rotation, vector(node.scale, 1.0));
}

/// A node's transform to the world, its last row made exact. Throws Error where it overflows.
glm::dmat4 checked_affine(glm::dmat4 matrix, const std::string& where, const GltfContext& context) {
  if (!all_finite(matrix)) context.fail(where, "its transform overflows");
  for (int column = 0; column < 4; ++column) matrix[column][3] = column == 3 ? 1.0 : 0.0;
  return matrix;
}

/// The one parent of every node, -1 for roots. Nodes that are used get theirs before others claim them.
std::vector<int> parents_of(const std::vector<tinygltf::Node>& nodes, GltfContext& context) {
  std::vector<int> parents(nodes.size(), -1);
  const auto adopt = [&](std::size_t node) {
    for (const int child : nodes[node].children) {
      int& parent = parents[GltfData::to_size(child)];
      if (parent >= 0) {
        context.fail(node_path(node) + ".children",
                     fmt::format("node {} is already a child of node {}", child, parent));
      }
      parent = static_cast<int>(node);
    }
  };
  for (const bool used : {true, false}) {
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      if (context.is_used("nodes", i) == used) context.check_entry("nodes", i, [&] { adopt(i); });
    }
  }
  return parents;
}

/// All nodes at and below `roots`, each once, parents first where no root is another's descendant, in the order of the
/// document.
std::vector<int> descend(const std::vector<tinygltf::Node>& nodes, const std::vector<int>& parents,
                         const std::vector<int>& roots) {
  std::vector<int> order;
  std::vector<bool> reached(nodes.size(), false);
  std::vector<int> open(roots.rbegin(), roots.rend());
  while (!open.empty()) {
    const int node = open.back();
    open.pop_back();
    if (reached[GltfData::to_size(node)]) continue;
    reached[GltfData::to_size(node)] = true;
    order.push_back(node);
    std::vector<int> below;
    std::ranges::copy_if(nodes[GltfData::to_size(node)].children, std::back_inserter(below),
                         [&](int child) { return parents[GltfData::to_size(child)] == node; });
    open.insert(open.end(), below.rbegin(), below.rend());
  }
  return order;
}

/// The nodes of the drawn scene from which its others descend. A node that is another's child stands where that puts it
/// (glTF 2.0, section 3.5.3), also where the scene names it as a root.
std::vector<int> scene_roots(const GltfData& data, const std::vector<int>& parents, const std::vector<int>& roots) {
  const tinygltf::Model& model = data.model();
  if (model.scenes.empty()) {
    data.context().warn("", "the document has no scene; all its nodes are drawn");
    return roots;
  }
  const std::size_t active = model.defaultScene >= 0 ? GltfData::to_size(model.defaultScene) : 0;
  const std::string where = fmt::format("scenes[{}].nodes", active);
  std::vector<bool> seen(model.nodes.size(), false);
  std::vector<int> named = model.scenes[active].nodes;
  for (const int node : named) {
    const std::size_t i = GltfData::to_size(node);
    if (seen[i]) data.context().warn(where, fmt::format("names node {} twice; it is drawn once", node));
    if (parents[i] >= 0) {
      data.context().warn(
          where,
          fmt::format("node {} is a child of node {}, not a root; it is drawn once, as that child", node, parents[i]));
    }
    seen[i] = true;
  }
  // Those that descend from others come last, when they have been reached already.
  std::stable_partition(named.begin(), named.end(), [&](int node) { return parents[GltfData::to_size(node)] < 0; });
  return named;
}

/// Refuses nodes that are used and lie on or below a cycle: with at most one parent each, those that no root reaches.
/// Descent from a used node makes all nodes of a cycle used.
void check_cycles(GltfContext& context, std::size_t nodes, const std::vector<int>& order) {
  if (order.size() == nodes) return;
  std::vector<bool> reached(nodes, false);
  for (const int node : order) reached[GltfData::to_size(node)] = true;
  for (std::size_t i = 0; i < nodes; ++i) {
    if (reached[i]) continue;
    context.check_entry("nodes", i, [&] { context.fail(node_path(i), "is its own ancestor"); });
  }
}

bool is_hidden(const tinygltf::Node& node) {
  const auto found = node.extensions.find("KHR_node_visibility");
  return found != node.extensions.end() && found->second.Has("visible") && !found->second.Get("visible").Get<bool>();
}

/// How many instances the attributes of EXT_mesh_gpu_instancing describe.
std::size_t instance_count(const GltfData& data, const tinygltf::Value& attributes, const std::string& where) {
  std::size_t count = 0;
  for (const std::string& name : attributes.Keys()) {
    const std::size_t own = data.count(attributes.Get(name).GetNumberAsInt());
    if (count != 0 && own != count) data.context().fail(where, "its attributes differ in how many instances there are");
    count = own;
  }
  return count;
}

/// Checks that nodes that are used form trees (no node twice, no cycle) and composes their transforms in double;
/// without recursion, so that a chain may be as long as it likes. Throws Error (BadInput) also for projective matrices
/// and transforms that overflow.
GltfNodes place_nodes(const GltfData& data) {
  const auto& nodes = data.model().nodes;
  data.context().charge(nodes.size() * (sizeof(glm::dmat4) + 4 * sizeof(int)), "the nodes");
  const std::vector<int> parents = parents_of(nodes, data.context());
  std::vector<int> roots;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (parents[i] < 0) roots.push_back(static_cast<int>(i));
  }
  const std::vector<int> order = descend(nodes, parents, roots);
  check_cycles(data.context(), nodes.size(), order);

  GltfNodes placed;
  placed.to_world.assign(nodes.size(), glm::dmat4(1.0));
  placed.hidden.assign(nodes.size(), false);
  for (const int node : order) {
    const std::size_t i = GltfData::to_size(node);
    placed.hidden[i] = is_hidden(nodes[i]) || (parents[i] >= 0 && placed.hidden[GltfData::to_size(parents[i])]);
    data.context().check_entry("nodes", i, [&] {
      const std::string where = node_path(i);
      const glm::dmat4 local = local_matrix(nodes[i], where, data.context());
      placed.to_world[i] = checked_affine(
          parents[i] >= 0 ? placed.to_world[GltfData::to_size(parents[i])] * local : local, where, data.context());
    });
  }
  placed.drawn = descend(nodes, parents, scene_roots(data, parents, roots));
  return placed;
}

/// A node's transforms by EXT_mesh_gpu_instancing, in its own coordinates; one identity without. Throws Error.
std::vector<glm::dmat4> gpu_instances(const GltfData& data, int node) {
  const auto& extensions = data.model().nodes[GltfData::to_size(node)].extensions;
  const auto found = extensions.find("EXT_mesh_gpu_instancing");
  if (found == extensions.end()) return {glm::dmat4(1.0)};
  const std::string where = node_path(GltfData::to_size(node)) + ".EXT_mesh_gpu_instancing";
  const tinygltf::Value& attributes = found->second.Get("attributes");

  const auto find = [&](const char* name, int type) {
    const int accessor = attributes.Has(name) ? attributes.Get(name).GetNumberAsInt() : -1;
    if (accessor >= 0) data.require_type(accessor, {type}, fmt::format("{}.{}", where, name));
    return accessor;
  };
  const int translation = find("TRANSLATION", TINYGLTF_TYPE_VEC3);
  const int rotation = find("ROTATION", TINYGLTF_TYPE_VEC4);
  const int scale = find("SCALE", TINYGLTF_TYPE_VEC3);
  const std::size_t count = instance_count(data, attributes, where);
  if (count == 0) {
    data.context().warn(where, "has no attributes");
    return {glm::dmat4(1.0)};
  }

  const auto translations = translation >= 0 ? data.vec3s(translation) : std::vector<glm::vec3>();
  const auto rotations = rotation >= 0 ? data.vec4s(rotation) : std::vector<glm::vec4>();
  const auto scales = scale >= 0 ? data.vec3s(scale) : std::vector<glm::vec3>();
  data.context().charge(count * sizeof(glm::dmat4), "instances");
  std::vector<glm::dmat4> placed;
  placed.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    glm::dquat turn(1.0, 0.0, 0.0, 0.0);
    if (rotation >= 0) {
      const glm::vec4& r = rotations[i];
      turn = unit_rotation(r.x, r.y, r.z, r.w, where, data.context());
    }
    placed.push_back(from_parts(translation >= 0 ? glm::dvec3(translations[i]) : glm::dvec3(0.0), turn,
                                scale >= 0 ? glm::dvec3(scales[i]) : glm::dvec3(1.0)));
    if (!all_finite(placed.back())) data.context().fail(where, fmt::format("instance {} is not finite", i));
  }
  return placed;
}

/// The largest coordinate a mesh reaches in the world, or infinity.
double max_coordinate(const glm::dmat4& to_world, const glm::dvec3& max_abs) {
  double most = 0.0;
  for (int row = 0; row < 3; ++row) {
    const double sum = std::abs(to_world[0][row]) * max_abs.x + std::abs(to_world[1][row]) * max_abs.y +
                       std::abs(to_world[2][row]) * max_abs.z + std::abs(to_world[3][row]);
    most = std::max(most, std::isfinite(sum) ? sum : std::numeric_limits<double>::infinity());
  }
  return most;
}

glm::dvec3 max_abs_coordinates(const Mesh& mesh) {
  glm::dvec3 max_abs(0.0);
  for (const glm::vec3& p : mesh.positions) max_abs = glm::max(max_abs, glm::abs(glm::dvec3(p)));
  return max_abs;
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
    if (needs_default) {
      Material& material = scene_.materials.emplace_back();
      material.name = "default";
      material.double_sided = false;
    }
    show_without_light();
    if (singular_ > 0) context().warn("", fmt::format("{} nodes have a singular matrix", singular_));
    if (scene_.instances.empty()) context().warn("", "the scene has nothing to draw");
  }

  /// A mesh of the scene once more, as it was before its triangles were left out; but for its name and material.
  [[nodiscard]] std::unique_ptr<MeshReader> read_mesh(std::uint32_t index) const {
    const Source& source = sources_.at(index);
    const tinygltf::Node& node = data_.model().nodes[GltfData::to_size(source.node)];
    if (source.in_pieces) {
      if (auto reader = pieces_of(node, source.primitive)) return reader;  // else the file changed
    }
    return std::make_unique<WholeMeshReader>(build(node, source.primitive).value_or(Mesh()));
  }

 private:
  /// A node that shows a mesh, and which primitive of its mesh that is.
  struct Source {
    int node = 0;
    std::size_t primitive = 0;
    bool in_pieces = false;
  };

  /// Which meshes come of a glTF mesh in one pose: (mesh, skin, weights).
  using PoseKey = std::tuple<int, int, std::vector<double>>;

  [[nodiscard]] GltfContext& context() const { return data_.context(); }

  void add_node(int node) {
    const tinygltf::Node& from = data_.model().nodes[GltfData::to_size(node)];
    const glm::dmat4& to_world = nodes_.to_world[GltfData::to_size(node)];
    if (auto camera = camera_of(data_, node, to_world)) {
      if (camera->name.empty()) camera->name = fmt::format("camera{}", scene_.cameras.size());
      scene_.cameras.push_back(*std::move(camera));
    }
    if (nodes_.hidden[GltfData::to_size(node)]) return;
    if (auto light = light_of(data_, node, to_world)) scene_.lights.push_back(*std::move(light));
    if (from.mesh < 0) {
      if (from.skin >= 0) context().warn(fmt::format("nodes[{}]", node), "has a skin but no mesh");
      return;
    }
    const std::vector<std::uint32_t>& meshes = meshes_of(node);
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
        if (max_coordinate(instance.to_world, max_abs_[mesh]) > kMaxCoordinate) {
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

  /// Builds a primitive of a node's mesh, in its pose.
  [[nodiscard]] std::optional<Mesh> build(const tinygltf::Node& node, std::size_t primitive) const {
    return build_primitive(data_, primitive_of(node, primitive), primitive_path(node, primitive), pose_of(node),
                           default_material_);
  }

  /// Reads one in pieces, where that is possible.
  [[nodiscard]] std::unique_ptr<MeshReader> pieces_of(const tinygltf::Node& node, std::size_t primitive) const {
    if (!context().reads_in_parts()) return nullptr;
    const tinygltf::Primitive& from = primitive_of(node, primitive);
    Mesh mesh;
    mesh.material = from.material >= 0 ? static_cast<std::uint32_t>(from.material) : default_material_;
    if (is_held_by_all(scene_, mesh)) return nullptr;
    auto reader = read_primitive_in_pieces(data_, from, pose_of(node));
    if (reader) reader->material = mesh.material;
    return reader;
  }

  [[nodiscard]] const tinygltf::Primitive& primitive_of(const tinygltf::Node& node, std::size_t primitive) const {
    return data_.model().meshes[GltfData::to_size(node.mesh)].primitives[primitive];
  }

  [[nodiscard]] GltfPose pose_of(const tinygltf::Node& node) const {
    const tinygltf::Mesh& mesh = data_.model().meshes[GltfData::to_size(node.mesh)];
    return {node.weights.empty() ? mesh.weights : node.weights, joints_of(node.skin)};
  }

  static std::string primitive_path(const tinygltf::Node& node, std::size_t primitive) {
    return fmt::format("meshes[{}].primitives[{}]", node.mesh, primitive);
  }

  const std::vector<std::uint32_t>& meshes_of(int index) {
    const tinygltf::Node& node = data_.model().nodes[GltfData::to_size(index)];
    const tinygltf::Mesh& from = data_.model().meshes[GltfData::to_size(node.mesh)];
    PoseKey key{node.mesh, node.skin, node.weights.empty() ? from.weights : node.weights};
    const auto known = meshes_.find(key);
    if (known != meshes_.end()) return known->second;

    check_weights(node, from);
    std::vector<std::uint32_t> made;
    for (std::size_t p = 0; p < from.primitives.size(); ++p) {
      const std::string name = from.primitives.size() > 1 ? fmt::format("{}.{}", from.name, p) : from.name;
      const auto number = static_cast<std::uint32_t>(scene_.meshes.size());
      const auto reader = pieces_of(node, p);
      if (reader) {
        reader->name = name;
        check_texture_coordinates(reader->material, {reader->has(VertexArray::Uvs0), reader->has(VertexArray::Uvs1)},
                                  primitive_path(node, p));
        scene_.meshes.push_back(without_triangles(*reader));
        max_abs_.push_back(scene_.meshes.back().partial->reach);
        data_.forget();
      } else if (!add_whole(node, p, name)) {
        continue;
      }
      made.push_back(number);
      sources_.push_back({index, p, reader != nullptr});
    }
    return meshes_.emplace(std::move(key), std::move(made)).first->second;
  }

  /// Reads a primitive whole, and adds it to the scene if it is a mesh.
  bool add_whole(const tinygltf::Node& node, std::size_t primitive, const std::string& name) {
    const std::uint64_t charged = context().charged();
    auto mesh = build(node, primitive);
    if (!mesh) return false;
    check_texture_coordinates(mesh->material, {!mesh->uvs[0].empty(), !mesh->uvs[1].empty()},
                              primitive_path(node, primitive));
    mesh->name = name;
    max_abs_.push_back(max_abs_coordinates(*mesh));
    if (mesh->kind != MeshKind::Triangles && !primitive_of(node, primitive).attributes.contains("NORMAL")) {
      unlit_.push_back(static_cast<std::uint32_t>(scene_.meshes.size()));
    }
    keep(*std::move(mesh), charged);
    return true;
  }

  /// Adds a mesh to the scene; `charged`: what was counted before it was read.
  void keep(Mesh mesh, std::uint64_t charged) {
    if (!context().reads_in_parts() || is_held_by_all(scene_, mesh)) {
      scene_.meshes.push_back(std::move(mesh));
      return;
    }
    scene_.meshes.push_back(without_triangles(mesh));
    context().release_to(charged);
    data_.forget();
  }

  /// Points and lines without normals show the sum of base color and emission (glTF 2.0, section 3.9.6): by a copy of
  /// their material that takes no light. The sum is that of the material's factors, where nothing else has a part in
  /// it.
  void show_without_light() {
    std::map<std::pair<std::uint32_t, bool>, std::uint32_t> copies;  // by material and whether vertices have colors
    for (const std::uint32_t mesh : unlit_) {
      const std::uint32_t lit = scene_.meshes[mesh].material;
      if (scene_.materials[lit].unlit) continue;
      const bool has_colors = !scene_.meshes[mesh].colors.empty();
      const auto [copy, added] =
          copies.try_emplace({lit, has_colors}, static_cast<std::uint32_t>(scene_.materials.size()));
      scene_.meshes[mesh].material = copy->second;
      if (!added) continue;
      Material material = scene_.materials[lit];
      if (!has_colors && !material.base_color_texture.present() && !material.emissive_texture.present()) {
        const glm::vec3 sum = glm::vec3(material.base_color) + material.emissive;
        material.base_color = glm::vec4(glm::min(sum, glm::vec3(1.0F)), material.base_color.a);
      }
      material.unlit = true;
      material.emissive = glm::vec3(0.0F);
      material.extensions = nullptr;
      scene_.materials.push_back(std::move(material));
    }
  }

  void check_weights(const tinygltf::Node& node, const tinygltf::Mesh& mesh) const {
    if (node.weights.empty() || mesh.primitives.empty()) return;
    const std::size_t targets = mesh.primitives.front().targets.size();
    if (node.weights.size() == targets) return;
    context().warn(fmt::format("nodes[{}].weights", &node - data_.model().nodes.data()),
                   fmt::format("{} weights for {} morph targets", node.weights.size(), targets));
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

  void check_texture_coordinates(std::uint32_t number, const std::array<bool, 2>& has_uvs,
                                 const std::string& where) const {
    if (number >= scene_.materials.size()) return;
    const Material& material = scene_.materials[number];
    const auto check = [&](const TextureRef& ref) {
      if (!ref.present() || has_uvs.at(ref.uv_set)) return;
      context().warn(where, fmt::format("has no TEXCOORD_{} for the texture of its material", ref.uv_set));
    };
    for (const TextureRef* ref :
         {&material.base_color_texture, &material.metallic_roughness_texture, &material.emissive_texture,
          &material.normal_texture, &material.occlusion_texture, &material.transmission_texture}) {
      check(*ref);
    }
    if (!material.extensions) return;
    for (const TextureRef* ref : material.extensions->textures()) check(*ref);
  }

  const GltfData& data_;
  Scene& scene_;
  GltfNodes nodes_;
  std::map<PoseKey, std::vector<std::uint32_t>> meshes_;
  std::vector<Source> sources_;       ///< per mesh of the scene
  std::vector<glm::dvec3> max_abs_;   ///< per mesh of the scene
  std::vector<std::uint32_t> unlit_;  ///< meshes of points and lines without normals
  std::uint32_t default_material_ = 0;
  std::size_t singular_ = 0;
};

void check_skin(const GltfData& data, std::size_t index) {
  const tinygltf::Skin& skin = data.model().skins[index];
  const int matrices = skin.inverseBindMatrices;
  if (matrices < 0) return;
  const std::string where = fmt::format("skins[{}].inverseBindMatrices", index);
  data.require_type(matrices, {TINYGLTF_TYPE_MAT4}, where);
  if (data.accessor(matrices).componentType != TINYGLTF_COMPONENT_TYPE_FLOAT) {
    data.context().fail(where, "must be floats");
  }
  if (data.count(matrices) < skin.joints.size()) {
    data.context().fail(where, fmt::format("{} matrices for {} joints", data.count(matrices), skin.joints.size()));
  }
}

/// Adds the file that holds a buffer or picture, if it names one.
void add_named(const Json& item, const std::filesystem::path& folder, std::vector<std::filesystem::path>& files) {
  const Json& uri = item["uri"];
  if (!uri.is_string() || is_data_uri(uri.string())) return;
  try {
    files.push_back(folder / jailed_path(uri.string(), ""));
  } catch (const Error&) {  // load_gltf reports it
  }
}

/// The buffers and pictures that a document names; none of one that load_gltf would refuse.
std::vector<std::filesystem::path> files_beside(const std::filesystem::path& path, const SceneLimits& limits) {
  std::vector<std::filesystem::path> files;
  try {
    GltfContext context(path.string(), limits);
    const GltfFile file = open_gltf(path, context);
    const Json root = Json::try_parse(file.parts.json).value_or(Json());
    for (const char* const list : {"buffers", "images"}) {
      if (!root[list].is_array()) continue;
      for (const Json& item : root[list].elements()) add_named(item, path.parent_path(), files);
    }
  } catch (const Error&) {  // load_gltf reports it
  }
  return files;
}

/// A file and what was read of it, from which meshes can be read again.
class GltfReader {
 public:
  GltfReader(const std::filesystem::path& path, const SceneLimits& limits, const SceneChoice& choice, bool in_parts)
      : context_(path.string(), limits, in_parts),
        file_(open_gltf(path, context_)),
        buffers_(path.parent_path(), file_.parts, &file_.bytes) {
    Json root = parse_json(file_.parts.json, context_);
    const std::size_t drawn = check(root, choice);
    scene_.name = path.stem().string();
    scene_.scenes = scene_names(root);
    scene_.variants = variant_names(root);
    buffers_.load(root, context_);
    decode_meshopt_views(root, buffers_, context_);
    decode_draco_primitives(root, buffers_, context_);
    context_.set_usage(usage_of(root, drawn));  // with what decoding added
    const Json images = root.contains("images") ? std::move(root["images"]) : Json();
    model_ = parse_model(std::move(root), context_);
    data_.emplace(model_, buffers_, context_);
    check_meshes(*data_);
    for (std::size_t i = 0; i < model_.skins.size(); ++i) {
      context_.check_entry("skins", i, [&] { check_skin(*data_, i); });
    }
    GltfMaterials materials(*data_, buffers_, images);
    materials.build(scene_);
    sources_ = materials.take_sources();
    builder_.emplace(*data_, scene_);
    builder_->build();
    scene_.warnings = context_.take_warnings();
    scene_.not_finite = context_.not_finite();
    finish_scene(scene_);
  }
  GltfReader(const GltfReader&) = delete;
  GltfReader& operator=(const GltfReader&) = delete;
  ~GltfReader() = default;

  /// To be called once each.
  [[nodiscard]] Scene take_scene() { return std::move(scene_); }
  [[nodiscard]] std::vector<std::shared_ptr<const PictureSource>> take_sources() { return std::move(sources_); }

  [[nodiscard]] std::unique_ptr<MeshReader> read_mesh(std::uint32_t index) {
    const std::uint64_t charged = context_.charged();
    auto mesh = builder_->read_mesh(index);
    context_.release_to(charged);
    buffers_.forget();
    return mesh;
  }

 private:
  /// Checks a document and chooses what is drawn of it; returns the number of the scene.
  std::size_t check(Json& root, const SceneChoice& choice) {
    if (!root.is_object()) context_.fail("", "this is no glTF: the JSON is not an object");
    check_extensions(root, context_);
    const std::size_t drawn = find_scene(root, choice.scene, context_);
    if (!choice.scene.empty()) root["scene"] = drawn;
    apply_variant(root, choice.variant, context_);
    context_.set_usage(usage_of(root, drawn));
    check_shape(root, context_);
    if (const std::size_t animations = root["animations"].size(); animations > 0) {
      context_.warn(
          "animations",
          fmt::format("the file has {}; they are not played, things stand where its nodes put them", animations));
    }
    return drawn;
  }

  GltfContext context_;
  GltfFile file_;
  GltfBuffers buffers_;
  tinygltf::Model model_;
  std::optional<GltfData> data_;
  Scene scene_;
  std::vector<std::shared_ptr<const PictureSource>> sources_;
  std::optional<SceneBuilder> builder_;
};

}  // namespace

LoadedScene load_gltf(const std::filesystem::path& path, const SceneLimits& limits, const SceneChoice& choice,
                      bool in_parts) {
  const auto reader = std::make_shared<GltfReader>(path, limits, choice, in_parts);
  LoadedScene loaded(reader->take_scene());
  loaded.in_parts = in_parts;
  loaded.memory_limit = limits.memory_bytes;
  loaded.sources = reader->take_sources();
  if (in_parts) loaded.read_mesh = [reader](std::uint32_t mesh) { return reader->read_mesh(mesh); };
  return loaded;
}

SceneImporter gltf_importer() {
  return {{".gltf", ".glb"}, load_gltf, files_beside};
}

}  // namespace hpr
