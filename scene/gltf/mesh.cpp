#include "scene/gltf/mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <iterator>
#include <limits>
#include <string_view>
#include <utility>

#include "core/text.h"
#include "scene/gltf/pieces/vertex_rules.h"

namespace hpr {
namespace {

bool is_float(const tinygltf::Accessor& accessor) {
  return accessor.componentType == TINYGLTF_COMPONENT_TYPE_FLOAT;
}

/// Floats and normalised unsigned integers of one or two bytes.
bool is_fraction(const tinygltf::Accessor& accessor) {
  return is_float(accessor) ||
         (accessor.normalized && (accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE ||
                                  accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT));
}

class PrimitiveCheck {
 public:
  PrimitiveCheck(const GltfData& data, const tinygltf::Primitive& primitive, std::string where)
      : data_(data), primitive_(primitive), where_(std::move(where)) {
    const auto& used = data.model().extensionsUsed;
    quantized_ = std::ranges::find(used, "KHR_mesh_quantization") != used.end();
  }

  void run() {
    const auto position = primitive_.attributes.find("POSITION");
    if (position != primitive_.attributes.end()) {
      vertices_ = data_.count(position->second);
      check_bounds(position->second);
    }
    for (const auto& [name, accessor] : primitive_.attributes) {
      check_attribute(name, accessor, fmt::format("{}.attributes.{}", where_, printable(name)));
    }
    for (std::size_t i = 0; i < primitive_.targets.size(); ++i) {
      for (const auto& [name, accessor] : primitive_.targets[i]) {
        check_target(name, accessor, fmt::format("{}.targets[{}].{}", where_, i, printable(name)));
      }
    }
    if (primitive_.indices >= 0) check_indices();
  }

 private:
  void warn(const std::string& where, std::string_view what) const { data_.context().warn(where, what); }

  void check_count(int accessor, const std::string& where) const {
    if (vertices_ > 0 && data_.count(accessor) != vertices_) {
      data_.context().fail(where, fmt::format("has {} elements, POSITION has {}", data_.count(accessor), vertices_));
    }
  }

  void check_vector(int index, const std::string& where) const {
    data_.require_type(index, {TINYGLTF_TYPE_VEC3}, where);
    check_components(data_.accessor(index), where);
  }

  void check_components(const tinygltf::Accessor& accessor, const std::string& where) const {
    if (is_float(accessor)) return;
    if (accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT) {
      data_.context().fail(where, "is not made of floats");
    }
    if (!quantized_) warn(where, "is not made of floats, although KHR_mesh_quantization is not used");
  }

  void check_texture_coordinates(int index, const std::string& where) const {
    data_.require_type(index, {TINYGLTF_TYPE_VEC2}, where);
    if (!is_fraction(data_.accessor(index))) check_components(data_.accessor(index), where);
  }

  void check_attribute(const std::string& name, int index, const std::string& where) const {
    check_count(index, where);
    const tinygltf::Accessor& accessor = data_.accessor(index);
    if (name == "POSITION" || name == "NORMAL") {
      check_vector(index, where);
    } else if (name == "TANGENT") {
      data_.require_type(index, {TINYGLTF_TYPE_VEC4}, where);
      check_components(accessor, where);
    } else if (name.starts_with("TEXCOORD_")) {
      check_texture_coordinates(index, where);
    } else if (name.starts_with("COLOR_")) {
      data_.require_type(index, {TINYGLTF_TYPE_VEC3, TINYGLTF_TYPE_VEC4}, where);
      if (!is_fraction(accessor)) data_.context().fail(where, "must be floats or normalised integers");
      if (name != "COLOR_0") warn("", "vertex colours past the first are ignored");
    } else if (name.starts_with("JOINTS_")) {
      data_.require_type(index, {TINYGLTF_TYPE_VEC4}, where);
      if (accessor.componentType != TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE &&
          accessor.componentType != TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT) {
        data_.context().fail(where, "must be unsigned integers of one or two bytes");
      }
    } else if (name.starts_with("WEIGHTS_")) {
      data_.require_type(index, {TINYGLTF_TYPE_VEC4}, where);
      if (!is_fraction(accessor)) data_.context().fail(where, "must be floats or normalised integers");
    } else if (!name.starts_with('_')) {
      warn(where, "is no attribute of glTF and is ignored");
    }
  }

  void check_target(const std::string& name, int index, const std::string& where) const {
    check_count(index, where);
    if (name == "POSITION" || name == "NORMAL" || name == "TANGENT") return check_vector(index, where);
    if (name == "TEXCOORD_0" || name == "TEXCOORD_1") return check_texture_coordinates(index, where);
    if (name == "COLOR_0") return data_.require_type(index, {TINYGLTF_TYPE_VEC3, TINYGLTF_TYPE_VEC4}, where);
    if (!name.starts_with('_')) warn(where, "is not read");
  }

  void check_indices() const {
    const std::string where = where_ + ".indices";
    data_.require_type(primitive_.indices, {TINYGLTF_TYPE_SCALAR}, where);
    const tinygltf::Accessor& accessor = data_.accessor(primitive_.indices);
    if (accessor.componentType != TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE &&
        accessor.componentType != TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT &&
        accessor.componentType != TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT) {
      data_.context().fail(where, "must be unsigned integers");
    }
    if (accessor.normalized) warn(where, "are marked as normalised");
    if (accessor.bufferView >= 0 && data_.model().bufferViews[GltfData::to_size(accessor.bufferView)].byteStride != 0) {
      warn(where, "have a byteStride");
    }
  }

  /// glTF requires the box of positions; HPR computes its own, so that a wrong one does no harm.
  void check_bounds(int index) const {
    const tinygltf::Accessor& accessor = data_.accessor(index);
    const std::string where = fmt::format("accessors[{}]", index);
    if (accessor.minValues.size() != 3 || accessor.maxValues.size() != 3) {
      warn(where, "positions without min and max of three numbers");
      return;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (accessor.minValues[axis] > accessor.maxValues[axis]) warn(where, "min exceeds max");
    }
  }

  const GltfData& data_;
  const tinygltf::Primitive& primitive_;
  std::string where_;
  std::size_t vertices_ = 0;
  bool quantized_ = false;
};

void check_mesh(const GltfData& data, std::size_t index) {
  const tinygltf::Mesh& mesh = data.model().meshes[index];
  std::size_t targets = 0;
  std::size_t min_targets = std::numeric_limits<std::size_t>::max();
  for (std::size_t p = 0; p < mesh.primitives.size(); ++p) {
    PrimitiveCheck(data, mesh.primitives[p], fmt::format("meshes[{}].primitives[{}]", index, p)).run();
    targets = std::max(targets, mesh.primitives[p].targets.size());
    min_targets = std::min(min_targets, mesh.primitives[p].targets.size());
  }
  if (min_targets < targets) {
    data.context().warn(fmt::format("meshes[{}].primitives", index),
                        fmt::format("some have {} morph targets, others {}; those that are missing move nothing",
                                    targets, min_targets));
  }
  if (!mesh.weights.empty() && mesh.weights.size() != targets) {
    data.context().warn(fmt::format("meshes[{}].weights", index),
                        fmt::format("{} weights for {} morph targets", mesh.weights.size(), targets));
  }
}

}  // namespace

void check_meshes(const GltfData& data) {
  const auto& meshes = data.model().meshes;
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    data.context().check_entry("meshes", m, [&] { check_mesh(data, m); });
  }
}

namespace {

using Vectors = std::vector<glm::vec3>;

bool finite(const glm::vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

/// Works on one primitive from its accessors to a finished mesh.
class PrimitiveBuilder {
 public:
  PrimitiveBuilder(const GltfData& data, const tinygltf::Primitive& primitive, const std::string& where)
      : data_(data), primitive_(primitive), where_(where) {}

  Mesh build(const GltfPose& pose) {
    Mesh mesh;
    mesh.positions = data_.vec3s(primitive_.attributes.at("POSITION"));
    check_positions(mesh.positions);
    if (pose.joints.empty() && pose.weights.empty()) compare_bounds(mesh.positions);
    if (primitive_.mode < TINYGLTF_MODE_TRIANGLES) return build_points_or_lines(std::move(mesh), pose);
    if (const auto found = primitive_.attributes.find("NORMAL"); found != primitive_.attributes.end()) {
      mesh.normals = data_.vec3s(found->second);
      note_not_finite(mesh.normals, "NORMAL");
    }
    read_uvs(mesh);
    read_colors(mesh);
    // Tangents without normals are to be ignored (glTF 2.0, section 3.7.2.1).
    if (const auto found = primitive_.attributes.find("TANGENT");
        found != primitive_.attributes.end() && !mesh.normals.empty()) {
      mesh.tangents = data_.vec4s(found->second);
      note_not_finite(mesh.tangents, "TANGENT");
    }
    mesh.triangles = read_triangles(mesh.positions.size(), read_indices(mesh.positions.size()));
    morph(mesh, pose.weights);
    tame_uvs(mesh);
    tame_colors(mesh);
    if (!pose.joints.empty()) skin(mesh, pose.joints);
    if (mesh.normals.empty()) {
      make_flat(mesh);
    } else {
      repair_normals(mesh);
      repair_tangents(mesh);
    }
    return mesh;
  }

 private:
  /// Their normals and tangents are those of the solids they become.
  [[nodiscard]] Mesh build_points_or_lines(Mesh mesh, const GltfPose& pose) const {
    mesh.kind = primitive_.mode == TINYGLTF_MODE_POINTS ? MeshKind::Points : MeshKind::Lines;
    read_uvs(mesh);
    read_colors(mesh);
    const std::vector<std::uint32_t> indices = read_indices(mesh.positions.size());
    const std::size_t count = primitive_.indices >= 0 ? indices.size() : mesh.positions.size();
    const bool is_list = primitive_.mode == TINYGLTF_MODE_LINE;
    if (mesh.kind == MeshKind::Lines && (count < 2 || (is_list && count % 2 != 0))) {
      data_.context().warn(where_, fmt::format("{} vertices make no whole number of lines", count));
    }
    data_.context().charge(count / (is_list ? 2 : 1) * sizeof(glm::uvec3), "points and lines");
    mesh.triangles = points_or_lines_of(primitive_.mode, mesh.positions.size(), indices);
    morph(mesh, pose.weights);
    tame_uvs(mesh);
    tame_colors(mesh);
    if (!pose.joints.empty()) skin(mesh, pose.joints);
    return mesh;
  }

  /// What is no number is replaced wherever the attribute's values are looked at; here it is counted.
  template <typename Vector>
  void note_not_finite(const std::vector<Vector>& values, std::string_view attribute) const {
    std::uint64_t count = 0;
    std::size_t first = 0;
    for (std::size_t i = 0; i < values.size(); ++i) {
      for (int axis = 0; axis < Vector::length(); ++axis) {
        if (!std::isfinite(values[i][axis]) && count++ == 0) first = i;
      }
    }
    data_.context().warn_not_finite(fmt::format("{}.attributes.{}", where_, attribute), count, first);
  }

  void check_positions(const Vectors& positions) const {
    const auto bad = std::ranges::find_if_not(positions, finite);
    if (bad != positions.end()) {
      data_.context().fail(where_ + ".attributes.POSITION",
                           fmt::format("vertex {} is not finite", bad - positions.begin()));
    }
  }

  /// Triangles name their vertices in 32 bits.
  void check_vertex_count(std::size_t vertices) const {
    constexpr std::size_t kMaxVertices = std::numeric_limits<std::uint32_t>::max();
    if (vertices <= kMaxVertices) return;
    data_.context().fail(where_, fmt::format("needs {} vertices; a mesh may have {}", vertices, kMaxVertices),
                         "divide the mesh", ExitCode::Limit);
  }

  void compare_bounds(const Vectors& positions) const {
    glm::vec3 low = positions[0];
    glm::vec3 high = positions[0];
    for (const glm::vec3& p : positions) {
      low = glm::min(low, p);
      high = glm::max(high, p);
    }
    if (leaves_declared_bounds(data_.accessor(primitive_.attributes.at("POSITION")), low, high)) {
      data_.context().warn(where_, "vertices lie outside of the min and max their accessor declares");
    }
  }

  void read_uvs(Mesh& mesh) const {
    for (const auto& [name, set] : {std::pair{"TEXCOORD_0", 0U}, std::pair{"TEXCOORD_1", 1U}}) {
      const auto found = primitive_.attributes.find(name);
      if (found == primitive_.attributes.end()) continue;
      mesh.uvs[set] = data_.vec2s(found->second);
      note_not_finite(mesh.uvs[set], name);
    }
  }

  void tame_uvs(Mesh& mesh) const {
    for (const auto& [name, set] : {std::pair{"TEXCOORD_0", 0U}, std::pair{"TEXCOORD_1", 1U}}) {
      bool odd = false;
      for (glm::vec2& uv : mesh.uvs[set]) odd = tame_uv(uv) || odd;
      if (odd) data_.context().warn(where_, fmt::format("{} has values that are not finite or beyond 1e6", name));
    }
  }

  void read_colors(Mesh& mesh) const {
    const auto found = primitive_.attributes.find("COLOR_0");
    if (found == primitive_.attributes.end()) return;
    if (data_.accessor(found->second).type == TINYGLTF_TYPE_VEC4) {
      mesh.colors = data_.vec4s(found->second);
    } else {
      const Vectors opaque = data_.vec3s(found->second);
      data_.context().charge(opaque.size() * sizeof(glm::vec4), "vertex colours");
      for (const glm::vec3& color : opaque) mesh.colors.emplace_back(color, 1.0F);
    }
    note_not_finite(mesh.colors, "COLOR_0");
  }

  void tame_colors(Mesh& mesh) const {
    bool odd = false;
    for (glm::vec4& color : mesh.colors) odd = tame_color(color) || odd;
    if (odd) data_.context().warn(where_ + ".attributes.COLOR_0", "some values lie outside of 0 to 1; brought into it");
  }

  /// None for a primitive without indices.
  [[nodiscard]] std::vector<std::uint32_t> read_indices(std::size_t vertices) const {
    check_vertex_count(vertices);
    std::vector<std::uint32_t> indices;
    if (primitive_.indices < 0) return indices;
    indices = data_.integers(primitive_.indices);
    const auto bad = std::ranges::find_if(indices, [&](std::uint32_t index) { return index >= vertices; });
    if (bad != indices.end()) {
      data_.context().fail(where_ + ".indices", fmt::format("index {} is {}, but there are {} vertices",
                                                            bad - indices.begin(), *bad, vertices));
    }
    return indices;
  }

  [[nodiscard]] std::vector<glm::uvec3> read_triangles(std::size_t vertices,
                                                       const std::vector<std::uint32_t>& indices) const {
    const std::size_t count = primitive_.indices >= 0 ? indices.size() : vertices;
    const bool list = primitive_.mode == TINYGLTF_MODE_TRIANGLES;
    if (count < 3 || (list && count % 3 != 0)) {
      data_.context().warn(where_, fmt::format("{} vertices make no whole number of triangles", count));
    }
    // A strip has up to three times as many corners as indices.
    data_.context().charge(std::uint64_t{count} * (list ? 4U : 12U), "a mesh");
    return triangles_of(primitive_.mode, vertices, indices);
  }

  void morph(Mesh& mesh, const std::vector<double>& weights) const {
    const std::size_t count = std::min(weights.size(), primitive_.targets.size());
    bool moved = false;
    for (std::size_t t = 0; t < count; ++t) {
      if (weights[t] == 0.0) continue;
      for (const auto& [name, index] : primitive_.targets[t]) move(mesh, name, index, weights[t]);
      moved = true;
    }
    if (moved) check_positions(mesh.positions);
  }

  void move(Mesh& mesh, const std::string& name, int index, double weight) const {
    const auto add = [&](const auto& deltas, auto& to) {
      using Delta = typename std::remove_cvref_t<decltype(deltas)>::value_type;
      for (std::size_t i = 0; i < to.size(); ++i) {
        for (int axis = 0; axis < Delta::length(); ++axis) {
          to[i][axis] = static_cast<float>(double{to[i][axis]} + weight * double{deltas[i][axis]});
        }
      }
    };
    // Targets of tangents leave their sign alone.
    if (name == "POSITION") add(data_.vec3s(index), mesh.positions);
    if (name == "NORMAL") add(data_.vec3s(index), mesh.normals);
    if (name == "TANGENT") add(data_.vec3s(index), mesh.tangents);
    if (name == "TEXCOORD_0") add(data_.vec2s(index), mesh.uvs[0]);
    if (name == "TEXCOORD_1") add(data_.vec2s(index), mesh.uvs[1]);
    if (name != "COLOR_0") return;
    if (data_.accessor(index).type == TINYGLTF_TYPE_VEC4) return add(data_.vec4s(index), mesh.colors);
    add(data_.vec3s(index), mesh.colors);
  }

  /// Four of the joints that move each vertex, and their weights: JOINTS_n and WEIGHTS_n.
  struct JointSet {
    std::vector<std::uint32_t> joints;  ///< four per vertex
    std::vector<glm::vec4> weights;
  };

  [[nodiscard]] std::vector<JointSet> read_joint_sets() const {
    std::vector<JointSet> sets;
    for (;;) {
      const auto joints = primitive_.attributes.find(fmt::format("JOINTS_{}", sets.size()));
      const auto weights = primitive_.attributes.find(fmt::format("WEIGHTS_{}", sets.size()));
      const bool has_joints = joints != primitive_.attributes.end();
      const bool has_weights = weights != primitive_.attributes.end();
      if (!has_joints || !has_weights) {
        if (!sets.empty() && has_joints != has_weights) {
          data_.context().warn(where_,
                               fmt::format("has only one of JOINTS_{0} and WEIGHTS_{0}; left out", sets.size()));
        }
        return sets;
      }
      sets.push_back({data_.integers(joints->second), data_.vec4s(weights->second)});
    }
  }

  void skin(Mesh& mesh, const std::vector<glm::dmat4>& joints) const {
    std::vector<JointSet> sets = read_joint_sets();
    if (sets.empty()) {
      data_.context().warn(where_, "has a skin, but not JOINTS_0 and WEIGHTS_0; drawn by its first joint");
      sets.push_back({std::vector<std::uint32_t>(mesh.positions.size() * 4, 0),
                      std::vector(mesh.positions.size(), glm::vec4(1.0F, 0.0F, 0.0F, 0.0F))});
    }
    bend(mesh, joints, sets);
  }

  /// What a vertex's joints do to it; sets `odd` where its weights are of no use.
  [[nodiscard]] glm::dmat4 blend_of(std::size_t vertex, const std::vector<glm::dmat4>& joints,
                                    const std::vector<JointSet>& sets, bool& odd) const {
    glm::dmat4 blend(0.0);
    double sum = 0.0;
    for (std::size_t k = 0; k < 4 * sets.size(); ++k) {
      const JointSet& set = sets[k / 4];
      const std::uint32_t joint = set.joints[4 * vertex + k % 4];
      const double weight = set.weights[vertex][static_cast<int>(k % 4)];
      if (!(weight > 0.0) || !std::isfinite(weight)) {
        odd = odd || weight != 0.0;
        continue;
      }
      if (joint >= joints.size()) {
        data_.context().fail(fmt::format("{}.attributes.JOINTS_{}", where_, k / 4),
                             fmt::format("vertex {} names joint {} of {}", vertex, joint, joints.size()));
      }
      blend += weight * joints[joint];
      sum += weight;
    }
    odd = odd || sum == 0.0;
    return sum > 0.0 ? blend / sum : joints[0];
  }

  void bend(Mesh& mesh, const std::vector<glm::dmat4>& joints, const std::vector<JointSet>& sets) const {
    bool odd = false;
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
      const glm::dmat4 blend = blend_of(i, joints, sets, odd);
      mesh.positions[i] = glm::vec3(blend * glm::dvec4(mesh.positions[i], 1.0));
      if (!mesh.normals.empty()) {
        // The inverse transpose but for its scale, which also exists for singular matrices.
        const glm::dmat3 m(blend);
        const glm::dmat3 cofactors(glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1]));
        const glm::dvec3 normal = cofactors * glm::dvec3(mesh.normals[i]);
        const double length = glm::length(normal);
        mesh.normals[i] = length > 0.0 ? glm::vec3(normal / length) : glm::vec3(0.0F);
      }
      if (!mesh.tangents.empty()) {
        glm::vec4& tangent = mesh.tangents[i];
        tangent = glm::vec4(glm::vec3(glm::dmat3(blend) * glm::dvec3(tangent)), tangent.w);
      }
    }
    if (odd) data_.context().warn(where_, "some vertices have weights that are of no use");
    check_positions(mesh.positions);
  }

  /// One face, one normal: every triangle gets vertices of its own.
  void make_flat(Mesh& mesh) const {
    const std::size_t corners = mesh.triangles.size() * 3;
    check_vertex_count(corners);
    const auto sets = std::ranges::count_if(mesh.uvs, [](const auto& uvs) { return !uvs.empty(); });
    const std::size_t colored = mesh.colors.empty() ? 0 : sizeof(glm::vec4);
    data_.context().charge(
        corners * (2 * sizeof(glm::vec3) + static_cast<std::size_t>(sets) * sizeof(glm::vec2) + colored),
        "a mesh without normals");
    Mesh flat;
    flat.positions.reserve(corners);
    flat.normals.reserve(corners);
    if (!mesh.colors.empty()) flat.colors.reserve(corners);
    for (std::size_t set = 0; set < mesh.uvs.size(); ++set) {
      if (!mesh.uvs[set].empty()) flat.uvs[set].reserve(corners);
    }
    for (glm::uvec3& triangle : mesh.triangles) {
      const glm::vec3 normal =
          flat_normal(mesh.positions[triangle.x], mesh.positions[triangle.y], mesh.positions[triangle.z]);
      const auto first = static_cast<std::uint32_t>(flat.positions.size());
      for (int corner = 0; corner < 3; ++corner) {
        flat.positions.push_back(mesh.positions[triangle[corner]]);
        flat.normals.push_back(normal);
        if (!mesh.colors.empty()) flat.colors.push_back(mesh.colors[triangle[corner]]);
        for (std::size_t set = 0; set < mesh.uvs.size(); ++set) {
          if (!mesh.uvs[set].empty()) flat.uvs[set].push_back(mesh.uvs[set][triangle[corner]]);
        }
      }
      triangle = {first, first + 1, first + 2};
    }
    flat.triangles = std::move(mesh.triangles);
    mesh = std::move(flat);
  }

  /// Normals become unit length; those without a direction are taken from the triangles around.
  void repair_normals(Mesh& mesh) const {
    Vectors smooth;
    bool scaled = false;
    for (std::size_t i = 0; i < mesh.normals.size(); ++i) {
      const NormalLength length = repair_normal(mesh.normals[i]);
      scaled = scaled || length == NormalLength::Other;
      if (length != NormalLength::None) continue;
      if (smooth.empty()) {
        data_.context().warn(where_ + ".attributes.NORMAL", "some normals have no direction; computed from the faces");
        data_.context().charge(mesh.positions.size() * sizeof(glm::vec3), "normals");
        smooth = smooth_normals(mesh.positions, mesh.triangles);
      }
      mesh.normals[i] = smooth[i];
    }
    if (scaled) data_.context().warn(where_ + ".attributes.NORMAL", "some normals are no unit vectors; made so");
  }

  void repair_tangents(Mesh& mesh) const {
    bool odd = false;
    for (glm::vec4& tangent : mesh.tangents) odd = repair_tangent(tangent) || odd;
    if (odd) {
      data_.context().warn(where_ + ".attributes.TANGENT", "some tangents are no unit vectors with a sign; made so");
    }
  }

  const GltfData& data_;
  const tinygltf::Primitive& primitive_;
  const std::string& where_;
};

}  // namespace

bool leaves_declared_bounds(const tinygltf::Accessor& positions, const glm::vec3& low, const glm::vec3& high) {
  if (positions.componentType != TINYGLTF_COMPONENT_TYPE_FLOAT) return false;
  if (positions.minValues.size() != 3 || positions.maxValues.size() != 3) return false;
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<std::size_t>(axis);
    const double slack = 1e-4 * (std::abs(positions.minValues[a]) + std::abs(positions.maxValues[a])) + 1e-6;
    if (low[axis] < positions.minValues[a] - slack || high[axis] > positions.maxValues[a] + slack) return true;
  }
  return false;
}

std::vector<glm::uvec3> triangles_of(int mode, std::size_t count, std::span<const std::uint32_t> indices) {
  const std::size_t corners = indices.empty() ? count : indices.size();
  const auto at = [&](std::size_t i) { return indices.empty() ? static_cast<std::uint32_t>(i) : indices[i]; };
  std::vector<glm::uvec3> triangles;
  if (corners < 3) return triangles;
  if (mode == TINYGLTF_MODE_TRIANGLES) {
    triangles.resize(corners / 3);
    for (std::size_t t = 0; t < triangles.size(); ++t) triangles[t] = {at(3 * t), at(3 * t + 1), at(3 * t + 2)};
    return triangles;
  }
  triangles.resize(corners - 2);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    // Every other triangle of a strip is turned, so that all face the same way (glTF 2.0, section 3.7.2.1).
    const std::size_t odd = t % 2;
    triangles[t] = mode == TINYGLTF_MODE_TRIANGLE_STRIP ? glm::uvec3{at(t), at(t + 1 + odd), at(t + 2 - odd)}
                                                        : glm::uvec3{at(t + 1), at(t + 2), at(0)};
  }
  return triangles;
}

std::vector<glm::uvec3> points_or_lines_of(int mode, std::size_t count, std::span<const std::uint32_t> indices) {
  const std::size_t corners = indices.empty() ? count : indices.size();
  const auto at = [&](std::size_t i) { return indices.empty() ? static_cast<std::uint32_t>(i) : indices[i]; };
  std::vector<glm::uvec3> parts;
  if (mode == TINYGLTF_MODE_POINTS) {
    parts.reserve(corners);
    for (std::size_t i = 0; i < corners; ++i) parts.emplace_back(at(i));
    return parts;
  }
  if (corners < 2) return parts;
  const std::size_t step = mode == TINYGLTF_MODE_LINE ? 2 : 1;
  parts.reserve(corners / step);
  for (std::size_t i = 0; i + 1 < corners; i += step) parts.emplace_back(at(i), at(i + 1), at(i + 1));
  if (mode == TINYGLTF_MODE_LINE_LOOP) parts.emplace_back(at(corners - 1), at(0), at(0));
  return parts;
}

std::optional<Mesh> build_primitive(const GltfData& data, const tinygltf::Primitive& primitive,
                                    const std::string& where, const GltfPose& pose, std::uint32_t default_material) {
  if (!primitive.attributes.contains("POSITION")) {
    data.context().warn(where, "has no positions and is left out");
    return std::nullopt;
  }
  Mesh mesh = PrimitiveBuilder(data, primitive, where).build(pose);
  mesh.material = primitive.material >= 0 ? static_cast<std::uint32_t>(primitive.material) : default_material;
  return mesh;
}

}  // namespace hpr
