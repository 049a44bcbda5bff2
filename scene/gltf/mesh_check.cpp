#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "core/text.h"
#include "scene/gltf/mesh.h"

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

  void check_attribute(const std::string& name, int index, const std::string& where) const {
    check_count(index, where);
    const tinygltf::Accessor& accessor = data_.accessor(index);
    if (name == "POSITION" || name == "NORMAL") {
      check_vector(index, where);
    } else if (name == "TANGENT") {
      data_.require_type(index, {TINYGLTF_TYPE_VEC4}, where);
      check_components(accessor, where);
    } else if (name.starts_with("TEXCOORD_")) {
      data_.require_type(index, {TINYGLTF_TYPE_VEC2}, where);
      if (!is_fraction(accessor) && !quantized_) warn(where, "is made neither of floats nor of normalised integers");
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
    if (name == "TEXCOORD_0" || name == "TEXCOORD_1") return data_.require_type(index, {TINYGLTF_TYPE_VEC2}, where);
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

}  // namespace

void check_meshes(const GltfData& data) {
  const auto& meshes = data.model().meshes;
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    std::size_t targets = 0;
    for (std::size_t p = 0; p < meshes[m].primitives.size(); ++p) {
      const tinygltf::Primitive& primitive = meshes[m].primitives[p];
      PrimitiveCheck(data, primitive, fmt::format("meshes[{}].primitives[{}]", m, p)).run();
      targets = std::max(targets, primitive.targets.size());
    }
    if (!meshes[m].weights.empty() && meshes[m].weights.size() != targets) {
      data.context().warn(fmt::format("meshes[{}].weights", m),
                          fmt::format("{} weights for {} morph targets", meshes[m].weights.size(), targets));
    }
  }
}

}  // namespace hpr
