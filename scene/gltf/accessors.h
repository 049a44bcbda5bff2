#pragma once

#include <tiny_gltf.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/file_bytes.h"
#include "core/json.h"
#include "scene/gltf/document.h"
#include "scene/gltf/scan.h"

namespace hpr {

/// Calls visit with a zero of the type that a component type of accessors stands for; float for what is none.
template <typename Visit>
decltype(auto) visit_component(int component_type, const Visit& visit) {
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return visit(std::int8_t{});
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return visit(std::uint8_t{});
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return visit(std::int16_t{});
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return visit(std::uint16_t{});
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return visit(std::uint32_t{});
    default:
      return visit(float{});
  }
}

/// Bytes of a file.
struct FileLocation {
  std::filesystem::path file;
  std::uint64_t file_bytes = 0;
  std::uint64_t offset = 0;
};

/// The bytes behind a document's buffers and pictures. Reads files only below the scene's folder.
class GltfBuffers {
 public:
  /// `parts` must outlive this, and so must the file they lie in, if it is to be forgotten.
  GltfBuffers(std::filesystem::path folder, const GltfParts& parts, const FileBytes* file = nullptr)
      : folder_(std::move(folder)), parts_(&parts), file_(file) {}

  /// Loads every buffer of a document whose shape was checked; each then has exactly its byteLength, but for those that
  /// cannot be loaded and are not used, and one that only stands in for compressed views (EXT_meshopt_compression) and
  /// that nothing reads: they are empty. Throws Error.
  void load(const Json& root, GltfContext& context);

  /// Adds a buffer that the document does not have; returns its index.
  std::size_t add(std::vector<std::byte> bytes);

  [[nodiscard]] std::size_t size() const { return bytes_.size(); }
  [[nodiscard]] std::span<const std::byte> operator[](std::size_t buffer) const { return bytes_[buffer]; }
  /// Part of a buffer. Throws Error (BadInput), naming `where`, for one that leaves the buffer.
  [[nodiscard]] std::span<const std::byte> range(std::size_t buffer, std::uint64_t offset, std::uint64_t length,
                                                 const std::string& where, const GltfContext& context) const;

  /// Where bytes of a buffer lie in a file that stays where it is; none of those that are in memory.
  [[nodiscard]] std::optional<FileLocation> location_of(std::span<const std::byte> bytes) const;

  /// Gives back the memory of files that were looked at and stay where they are.
  void forget() const;

  /// What a "uri" member holds: a data URI's bytes or a file's. Throws Error (Io, BadInput, Limit).
  [[nodiscard]] FileBytes resolve(const std::string& uri, const std::string& where, GltfContext& context) const;

 private:
  [[nodiscard]] std::span<const std::byte> load_buffer(const Json& buffer, std::size_t index, GltfContext& context);

  std::filesystem::path folder_;
  const GltfParts* parts_;
  const FileBytes* file_;
  std::filesystem::path document_;  ///< the file that parts_ point into, where it stays; else empty
  std::vector<FileBytes> owned_;
  std::vector<std::filesystem::path> paths_;  ///< of those that stay where they are; else empty
  std::vector<std::span<const std::byte>> bytes_;
};

/// tinygltf's model of the document, without its buffers and pictures: those are read by us alone, so that the library
/// never opens a file or decodes anything. Nor does it get animations, which are not played.
[[nodiscard]] tinygltf::Model parse_model(Json root, const GltfContext& context);

/// The elements of an accessor that has all its values in one place.
struct GltfElements {
  const std::byte* data = nullptr;  ///< of the first one
  std::size_t stride = 0;           ///< bytes from one to the next
  std::size_t width = 0;            ///< components
  int component_type = 0;
  bool normalized = false;

  /// Elements from `first` on as vec2s() and its like give them, or as integers() does.
  void read(std::size_t first, std::size_t count, float* out) const;
  void read(std::size_t first, std::size_t count, std::uint32_t* out) const;
};

/// A glTF model together with its bytes: accessors as plain arrays. Indices into sections were checked before
/// (check_shape); the constructor checks every range of bytes, so that reading cannot leave a buffer.
class GltfData {
 public:
  /// All three must outlive this. Throws Error (BadInput) for a view or accessor that leaves what holds it and is used.
  GltfData(const tinygltf::Model& model, const GltfBuffers& buffers, GltfContext& context);

  [[nodiscard]] const tinygltf::Model& model() const { return *model_; }
  [[nodiscard]] GltfContext& context() const { return *context_; }
  /// See GltfBuffers::forget.
  void forget() const { buffers_->forget(); }
  [[nodiscard]] const tinygltf::Accessor& accessor(int index) const { return model_->accessors[to_size(index)]; }
  [[nodiscard]] std::size_t count(int index) const { return accessor(index).count; }
  /// The bytes of a buffer view.
  [[nodiscard]] std::span<const std::byte> view(int index) const;

  /// Refuses an accessor whose type is not among `types` (TINYGLTF_TYPE_*); `where` is the path in the document that
  /// uses it.
  void require_type(int index, std::initializer_list<int> types, const std::string& where) const;

  /// All values as float: normalised integers in [0, 1] or [-1, 1], others as they are. The type must match.
  [[nodiscard]] std::vector<float> scalars(int index) const { return read<float>(index); }
  [[nodiscard]] std::vector<glm::vec2> vec2s(int index) const { return read<glm::vec2>(index); }
  [[nodiscard]] std::vector<glm::vec3> vec3s(int index) const { return read<glm::vec3>(index); }
  [[nodiscard]] std::vector<glm::vec4> vec4s(int index) const { return read<glm::vec4>(index); }
  [[nodiscard]] std::vector<glm::mat4> mat4s(int index) const { return read<glm::mat4>(index); }
  /// Unsigned integers (1, 2 or 4 bytes), `width` of them per element: vertex indices, joints.
  [[nodiscard]] std::vector<std::uint32_t> integers(int index) const;

  /// To read some of an accessor that has a view and is not sparse; of scalars and vectors.
  [[nodiscard]] GltfElements elements(int index) const;

  static std::size_t to_size(int index) { return static_cast<std::size_t>(index); }

 private:
  template <typename Value>
  [[nodiscard]] std::vector<Value> read(int index) const {
    context_->charge(count(index) * sizeof(Value), "an accessor");
    std::vector<Value> values(count(index));
    // NOLINTNEXTLINE(bugprone-sizeof-expression): a Value may be one float
    read_floats(index, reinterpret_cast<float*>(values.data()), sizeof(Value) / sizeof(float));
    forget_after(values.size() * sizeof(Value));
    return values;
  }
  /// Forgets files after so many bytes were read, if that is much.
  void forget_after(std::size_t bytes) const;
  void read_floats(int index, float* out, std::size_t width) const;
  void check_view(std::size_t index) const;
  void check_accessor(std::size_t index) const;
  void check_sparse(const tinygltf::Accessor& accessor, const std::string& where) const;
  /// The elements a sparse accessor replaces.
  [[nodiscard]] std::vector<std::uint32_t> sparse_targets(int index) const;

  const tinygltf::Model* model_;
  const GltfBuffers* buffers_;
  GltfContext* context_;
};

}  // namespace hpr
