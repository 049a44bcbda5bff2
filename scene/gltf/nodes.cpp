#include "scene/gltf/nodes.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>
#include <string>

namespace hpr {
namespace {

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

/// The one parent of every node, -1 for roots.
std::vector<int> parents_of(const std::vector<tinygltf::Node>& nodes, const GltfContext& context) {
  std::vector<int> parents(nodes.size(), -1);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    for (const int child : nodes[i].children) {
      int& parent = parents[GltfData::to_size(child)];
      if (parent >= 0) {
        context.fail(node_path(i) + ".children", fmt::format("node {} is already a child of node {}", child, parent));
      }
      parent = static_cast<int>(i);
    }
  }
  return parents;
}

/// All nodes below `roots`, parents first, in the order of the document.
std::vector<int> descend(const std::vector<tinygltf::Node>& nodes, const std::vector<int>& roots) {
  std::vector<int> order;
  std::vector<int> open(roots.rbegin(), roots.rend());
  while (!open.empty()) {
    const int node = open.back();
    open.pop_back();
    order.push_back(node);
    const auto& children = nodes[GltfData::to_size(node)].children;
    open.insert(open.end(), children.rbegin(), children.rend());
  }
  return order;
}

std::vector<int> scene_roots(const GltfData& data, const std::vector<int>& parents, const std::vector<int>& roots) {
  const tinygltf::Model& model = data.model();
  if (model.scenes.empty()) {
    data.context().warn("", "the document has no scene; all its nodes are drawn");
    return roots;
  }
  const std::size_t active = model.defaultScene >= 0 ? GltfData::to_size(model.defaultScene) : 0;
  const std::string where = fmt::format("scenes[{}].nodes", active);
  std::vector<bool> seen(model.nodes.size(), false);
  for (const int node : model.scenes[active].nodes) {
    const std::size_t i = GltfData::to_size(node);
    if (seen[i]) data.context().fail(where, fmt::format("names node {} twice", node));
    if (parents[i] >= 0) {
      data.context().fail(where, fmt::format("node {} is a child of node {}, not a root", node, parents[i]));
    }
    seen[i] = true;
  }
  return model.scenes[active].nodes;
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

}  // namespace

GltfNodes place_nodes(const GltfData& data) {
  const auto& nodes = data.model().nodes;
  data.context().charge(nodes.size() * (sizeof(glm::dmat4) + 4 * sizeof(int)), "the nodes");
  const std::vector<int> parents = parents_of(nodes, data.context());
  std::vector<int> roots;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (parents[i] < 0) roots.push_back(static_cast<int>(i));
  }
  // With at most one parent each, nodes that no root reaches can only lie on or below a cycle.
  const std::vector<int> order = descend(nodes, roots);
  if (order.size() != nodes.size()) {
    std::vector<bool> reached(nodes.size(), false);
    for (const int node : order) reached[GltfData::to_size(node)] = true;
    const auto missing = std::ranges::find(reached, false) - reached.begin();
    data.context().fail(node_path(static_cast<std::size_t>(missing)), "is its own ancestor");
  }

  GltfNodes placed;
  placed.to_world.assign(nodes.size(), glm::dmat4(1.0));
  for (const int node : order) {
    const std::size_t i = GltfData::to_size(node);
    const std::string where = node_path(i);
    glm::dmat4 matrix = local_matrix(nodes[i], where, data.context());
    if (parents[i] >= 0) matrix = placed.to_world[GltfData::to_size(parents[i])] * matrix;
    if (!all_finite(matrix)) data.context().fail(where, "its transform overflows");
    for (int column = 0; column < 4; ++column) matrix[column][3] = column == 3 ? 1.0 : 0.0;
    placed.to_world[i] = matrix;
  }
  placed.drawn = descend(nodes, scene_roots(data, parents, roots));
  return placed;
}

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

}  // namespace hpr
