#include "scene/gltf/pieces/primitive_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <glm/common.hpp>
#include <initializer_list>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include "core/error.h"
#include "scene/gltf/pieces/vertex_rules.h"

namespace hpr {
namespace {

constexpr std::uint32_t kPiece = 1U << 16U;

/// Counts what is looked at of a mapped file, and gives it back before it is much.
class ResidentBytes {
 public:
  explicit ResidentBytes(const GltfData& data) : data_(data) {}

  /// For bytes that are looked at one after the other.
  void add(std::size_t bytes) {
    if (bytes_ + bytes > kMaxBytes) forget();
    bytes_ += bytes;
  }

  /// For bytes that are looked at anywhere: systems map blocks of so many bytes around what is looked at.
  class Blocks {
   public:
    Blocks(ResidentBytes& resident, std::size_t bytes) : resident_(resident), seen_in_(bytes / kBlock + 2, 0) {}

    void touch(std::size_t offset) {
      std::uint32_t& seen = seen_in_[offset / kBlock];
      if (seen == resident_.round_) return;
      resident_.add(kBlock);
      seen = resident_.round_;
    }

   private:
    static constexpr std::size_t kBlock = std::size_t{64} << 10U;
    ResidentBytes& resident_;
    std::vector<std::uint32_t> seen_in_;  ///< of each block: the round in which it was looked at
  };

 private:
  static constexpr std::size_t kMaxBytes = std::size_t{16} << 20U;

  void forget() {
    data_.forget();
    bytes_ = 0;
    ++round_;
  }

  const GltfData& data_;
  std::size_t bytes_ = 0;
  std::uint32_t round_ = 1;
};

class PrimitiveReader final : public MeshReader {
 public:
  PrimitiveReader(const GltfData& data, const tinygltf::Primitive& primitive)
      : data_(data), resident_(data), positions_(data, primitive.attributes.at("POSITION"), resident_) {
    const auto find = [&](const char* attribute, VertexArray array) {
      const auto found = primitive.attributes.find(attribute);
      if (found != primitive.attributes.end()) at(array).emplace(data, found->second, resident_);
    };
    find("NORMAL", VertexArray::Normals);
    find("TEXCOORD_0", VertexArray::Uvs0);
    find("TEXCOORD_1", VertexArray::Uvs1);
    find("COLOR_0", VertexArray::Colors);
    is_flat_ = !at(VertexArray::Normals);
    if (!is_flat_) find("TANGENT", VertexArray::Tangents);
    if (primitive.indices >= 0) indices_.emplace(data, primitive.indices, resident_);
    stored_vertices_ = static_cast<std::uint32_t>(data.count(primitive.attributes.at("POSITION")));
    triangles_ =
        static_cast<std::uint32_t>((primitive.indices >= 0 ? data.count(primitive.indices) : stored_vertices_) / 3);
  }

  [[nodiscard]] std::uint32_t vertices() const override { return is_flat_ ? 3 * triangles_ : stored_vertices_; }
  [[nodiscard]] std::uint32_t triangles() const override { return triangles_; }
  [[nodiscard]] bool has(VertexArray array) const override {
    return array == VertexArray::Positions || (array == VertexArray::Normals && is_flat_) ||
           arrays_[static_cast<std::size_t>(array)];
  }

  void read(VertexArray array, std::uint32_t first, std::uint32_t last, std::vector<float>& to) override {
    if (is_flat_) return read_flat(array, first, last, to);
    source(array).read(first, last, to);
    repair(array, to);
  }

  void read_triangles(std::uint32_t first, std::uint32_t last, std::vector<glm::uvec3>& to) override {
    if (!is_flat_) return read_corners(first, last, to);
    to.resize(last - first);
    for (std::uint32_t t = first; t < last; ++t) to[t - first] = {3 * t, 3 * t + 1, 3 * t + 2};
  }

  void read_positions(std::span<const std::uint32_t> vertices, std::vector<glm::vec3>& to) override {
    std::span<const std::uint32_t> stored = vertices;
    if (is_flat_) {
      stored_.clear();
      for (const std::uint32_t vertex : vertices) stored_.push_back(corner(vertex));
      stored = stored_;
    }
    positions_.pick(stored, values_);
    check_positions(values_);
    to.resize(vertices.size());
    std::memcpy(to.data(), values_.data(), values_.size() * sizeof(float));
  }

  /// Reads all of it once as it is stored, and throws Error for what reading it whole would warn of.
  void check(const tinygltf::Accessor& positions) {
    for (const VertexArray array : kVertexArrays) {
      if (array != VertexArray::Positions && !arrays_[static_cast<std::size_t>(array)]) continue;
      glm::vec3 low(std::numeric_limits<float>::infinity());
      glm::vec3 high(-std::numeric_limits<float>::infinity());
      for (std::uint32_t first = 0; first < stored_vertices_;) {
        const std::uint32_t last = first + std::min(kPiece, stored_vertices_ - first);
        source(array).read(first, last, values_);
        repair(array, values_);
        first = last;
        if (array != VertexArray::Positions) continue;
        for (std::size_t i = 0; i < values_.size(); i += 3) {
          const glm::vec3 p(values_[i], values_[i + 1], values_[i + 2]);
          low = glm::min(low, p);
          high = glm::max(high, p);
        }
      }
      if (array == VertexArray::Positions && leaves_declared_bounds(positions, low, high)) fail();
    }
    std::vector<glm::uvec3> corners;
    for (std::uint32_t first = 0; first < triangles_; first += std::min(kPiece, triangles_ - first)) {
      read_corners(first, first + std::min(kPiece, triangles_ - first), corners);
    }
  }

 private:
  /// An accessor's values.
  class Source {
   public:
    Source(const GltfData& data, int accessor, ResidentBytes& resident)
        : elements_(data.elements(accessor)),
          resident_(&resident),
          blocks_(resident, data.count(accessor) * elements_.stride),
          has_alpha_(elements_.width == 4) {}

    void read(std::uint32_t first, std::uint32_t last, std::vector<float>& to) {
      to.resize((last - first) * elements_.width);
      resident_->add((last - first) * elements_.stride);
      elements_.read(first, last - first, to.data());
    }
    void read_integers(std::uint32_t first, std::uint32_t last, std::uint32_t* to) {
      resident_->add((last - first) * elements_.stride);
      elements_.read(first, last - first, to);
    }
    void pick(std::span<const std::uint32_t> which, std::vector<float>& to) {
      to.resize(which.size() * elements_.width);
      float* out = to.data();
      for (const std::uint32_t element : which) {
        blocks_.touch(element * elements_.stride);
        elements_.read(element, 1, out);
        out += elements_.width;
      }
    }
    [[nodiscard]] std::uint32_t integer(std::uint32_t element) {
      std::uint32_t value = 0;
      blocks_.touch(element * elements_.stride);
      elements_.read(element, 1, &value);
      return value;
    }
    [[nodiscard]] bool has_alpha() const { return has_alpha_; }

   private:
    GltfElements elements_;
    ResidentBytes* resident_;
    ResidentBytes::Blocks blocks_;
    bool has_alpha_;
  };

  [[noreturn]] void fail() const {
    throw Error(ExitCode::BadInput, fmt::format("{} changed while it was read", data_.context().name()),
                "leave the file alone until it is loaded");
  }

  std::optional<Source>& at(VertexArray array) { return arrays_[static_cast<std::size_t>(array)]; }
  Source& source(VertexArray array) { return array == VertexArray::Positions ? positions_ : *at(array); }

  void check_positions(std::span<const float> values) const {
    if (!std::ranges::all_of(values, [](float value) { return std::isfinite(value); })) fail();
  }

  /// What becomes of some vertices' values as they are stored. Throws Error for those that reading them whole warns of.
  void repair(VertexArray array, std::vector<float>& values) {
    if (array == VertexArray::Colors && !at(array)->has_alpha()) add_alpha(values);
    if (array == VertexArray::Positions) return check_positions(values);
    bool odd = false;
    const auto each = [&]<typename Value>(const auto& is_odd) {
      const std::span all(reinterpret_cast<Value*>(values.data()), values.size() / Value::length());
      for (Value& value : all) odd = is_odd(value) || odd;
    };
    switch (array) {
      case VertexArray::Normals:
        each.template operator()<glm::vec3>([](glm::vec3& n) { return repair_normal(n) != NormalLength::One; });
        break;
      case VertexArray::Colors:
        each.template operator()<glm::vec4>(tame_color);
        break;
      case VertexArray::Tangents:
        each.template operator()<glm::vec4>(repair_tangent);
        break;
      default:
        each.template operator()<glm::vec2>(tame_uv);
    }
    if (odd) fail();
  }

  static void add_alpha(std::vector<float>& values) {
    std::vector<float> opaque;
    opaque.reserve(values.size() / 3 * 4);
    for (std::size_t i = 0; i < values.size(); i += 3) {
      opaque.insert(opaque.end(), {values[i], values[i + 1], values[i + 2], 1.0F});
    }
    values = std::move(opaque);
  }

  /// The stored vertex of a corner, 3 t + 0, 1 or 2.
  [[nodiscard]] std::uint32_t corner(std::uint32_t corner) {
    const std::uint32_t vertex = indices_ ? indices_->integer(corner) : corner;
    if (vertex >= stored_vertices_) fail();
    return vertex;
  }

  void read_corners(std::uint32_t first, std::uint32_t last, std::vector<glm::uvec3>& to) {
    to.resize(last - first);
    std::uint32_t* const out = &to.data()->x;
    const std::size_t count = 3 * to.size();
    if (indices_) {
      indices_->read_integers(3 * first, 3 * last, out);
    } else {
      for (std::size_t i = 0; i < count; ++i) out[i] = 3 * first + static_cast<std::uint32_t>(i);
    }
    if (std::ranges::any_of(std::span(out, count), [&](std::uint32_t v) { return v >= stored_vertices_; })) fail();
  }

  /// One face, one normal: every triangle has vertices of its own.
  void read_flat(VertexArray array, std::uint32_t first, std::uint32_t last, std::vector<float>& to) {
    const std::uint32_t begin = array == VertexArray::Normals ? first / 3 : 0;
    const std::uint32_t end = (last + 2) / 3;
    stored_.clear();
    if (array != VertexArray::Normals) {
      for (std::uint32_t vertex = first; vertex < last; ++vertex) stored_.push_back(corner(vertex));
      source(array).pick(stored_, to);
      return repair(array, to);
    }
    for (std::uint32_t vertex = 3 * begin; vertex < 3 * end; ++vertex) stored_.push_back(corner(vertex));
    positions_.pick(stored_, values_);
    check_positions(values_);
    to.clear();
    const auto position = [&](std::size_t i) { return glm::vec3(values_[i], values_[i + 1], values_[i + 2]); };
    for (std::uint32_t vertex = first; vertex < last; ++vertex) {
      const std::size_t triangle = 9 * std::size_t{vertex / 3 - begin};
      const glm::vec3 normal = flat_normal(position(triangle), position(triangle + 3), position(triangle + 6));
      to.insert(to.end(), {normal.x, normal.y, normal.z});
    }
  }

  const GltfData& data_;
  ResidentBytes resident_;
  Source positions_;
  std::array<std::optional<Source>, kVertexArrays.size()> arrays_;  ///< but positions
  std::optional<Source> indices_;
  std::uint32_t stored_vertices_ = 0;
  std::uint32_t triangles_ = 0;
  bool is_flat_ = false;
  std::vector<std::uint32_t> stored_;
  std::vector<float> values_;
};

bool may_be_in_pieces(const GltfData& data, const tinygltf::Primitive& primitive, const GltfPose& pose) {
  if (primitive.mode != TINYGLTF_MODE_TRIANGLES || !primitive.attributes.contains("POSITION")) return false;
  if (!pose.joints.empty() || std::ranges::any_of(pose.weights, [](double w) { return w != 0.0; })) return false;
  const auto is_plain = [&](int accessor) {
    return data.accessor(accessor).bufferView >= 0 && !data.accessor(accessor).sparse.isSparse;
  };
  for (const char* const name : {"POSITION", "NORMAL", "TANGENT", "TEXCOORD_0", "TEXCOORD_1", "COLOR_0"}) {
    const auto found = primitive.attributes.find(name);
    if (found != primitive.attributes.end() && !is_plain(found->second)) return false;
  }
  const std::size_t vertices = data.count(primitive.attributes.at("POSITION"));
  if (primitive.indices >= 0 && !is_plain(primitive.indices)) return false;
  const std::size_t corners = primitive.indices >= 0 ? data.count(primitive.indices) : vertices;
  return corners >= 3 && corners % 3 == 0 && std::max(corners, vertices) <= std::numeric_limits<std::uint32_t>::max();
}

}  // namespace

std::unique_ptr<MeshReader> read_primitive_in_pieces(const GltfData& data, const tinygltf::Primitive& primitive,
                                                     const GltfPose& pose) {
  if (!may_be_in_pieces(data, primitive, pose)) return nullptr;
  auto reader = std::make_unique<PrimitiveReader>(data, primitive);
  if (memory_of(*reader) < kMinPieceBytes) return nullptr;
  try {
    reader->check(data.accessor(primitive.attributes.at("POSITION")));
  } catch (const Error&) {
    return nullptr;
  }
  return reader;
}

}  // namespace hpr
