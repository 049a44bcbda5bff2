#include "scene/gltf/accessors.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>

#include "core/error.h"
#include "core/text.h"
#include "scene/gltf/uri.h"

namespace hpr {
void GltfBuffers::forget() const {
  if (file_ != nullptr) file_->forget();
  for (const FileBytes& file : owned_) file.forget();
}

std::optional<FileLocation> GltfBuffers::location_of(std::span<const std::byte> bytes) const {
  const auto within = [&](std::span<const std::byte> file, const std::filesystem::path& path) {
    std::optional<FileLocation> location;
    const auto at = static_cast<std::uint64_t>(bytes.data() - file.data());
    if (!path.empty() && bytes.data() >= file.data() && at + bytes.size() <= file.size()) {
      location = {path, file.size(), at};
    }
    return location;
  };
  if (file_ != nullptr) {
    if (auto location = within(file_->bytes(), document_)) return location;
  }
  for (std::size_t i = 0; i < paths_.size(); ++i) {
    if (auto location = within(owned_[i].bytes(), paths_[i])) return location;
  }
  return std::nullopt;
}

FileBytes GltfBuffers::resolve(const std::string& uri, const std::string& where, GltfContext& context) const {
  constexpr std::uint64_t kNoLimit = std::numeric_limits<std::uint64_t>::max();  // where it takes no memory
  const std::string what = fmt::format("{}: {}", context.name(), where);
  if (is_data_uri(uri)) {
    context.charge(uri.size() / 4 * 3, "a data URI");
    return data_uri_bytes(uri, what);
  }
  if (context.reads_in_parts()) return read_jailed(folder_, uri, what, kNoLimit, true);
  FileBytes file = read_jailed(folder_, uri, what, std::min(context.limits().file_bytes, context.memory_left()));
  context.charge(file.bytes().size(), "a file");
  return file;
}

namespace {

const Json& meshopt_of(const Json& item) {
  return item["extensions"]["EXT_meshopt_compression"];
}

/// Which buffers some view reads: of a compressed view that of its compressed bytes.
std::vector<bool> buffers_read(const Json& root, std::size_t buffers) {
  std::vector<bool> read(buffers, false);
  const Json* const views = root.find("bufferViews");
  if (views == nullptr) return read;
  for (const Json& view : views->elements()) {
    const Json& compressed = meshopt_of(view);
    const auto buffer = (compressed.is_object() ? compressed : view)["buffer"].get<std::size_t>();
    if (buffer < buffers) read[buffer] = true;  // what stands in for a wrong view may name one there is not
  }
  return read;
}

/// a + b * c, none past 2^64.
std::optional<std::uint64_t> sum_of(std::uint64_t a, std::uint64_t b, std::uint64_t c) {
  std::uint64_t product = 0;
  std::uint64_t sum = 0;
  if (__builtin_mul_overflow(b, c, &product) || __builtin_add_overflow(a, product, &sum)) return std::nullopt;
  return sum;
}

}  // namespace

void GltfBuffers::load(const Json& root, GltfContext& context) {
  const Json* const found = root.find("buffers");
  if (found == nullptr) return;
  const std::vector<bool> read = buffers_read(root, found->size());
  owned_.resize(found->size());
  if (context.reads_in_parts()) {
    document_ = context.name();
    paths_.resize(found->size());
  }
  bytes_.resize(found->size());
  for (std::size_t i = 0; i < found->size(); ++i) {
    if (!read[i] && meshopt_of((*found)[i]).value("fallback", false)) continue;
    context.check_entry("buffers", i, [&] { bytes_[i] = load_buffer((*found)[i], i, context); });
  }
}

std::size_t GltfBuffers::add(std::vector<std::byte> bytes) {
  bytes_.emplace_back(owned_.emplace_back(std::move(bytes)).bytes());
  return bytes_.size() - 1;
}

std::span<const std::byte> GltfBuffers::load_buffer(const Json& buffer, std::size_t index, GltfContext& context) {
  const std::string where = fmt::format("buffers[{}]", index);
  std::span<const std::byte> bytes;
  if (buffer.contains("uri")) {
    const auto uri = buffer["uri"].get<std::string>();
    if (is_picture_uri(uri)) context.warn(where, "its data URI says that it is a picture");
    owned_[index] = resolve(uri, where, context);
    if (context.reads_in_parts() && !is_data_uri(uri)) paths_[index] = folder_ / jailed_path(uri, where);
    bytes = owned_[index].bytes();
  } else if (index == 0 && parts_->has_binary) {
    bytes = parts_->binary;
  } else {
    context.fail(where, "has neither a uri nor a BIN chunk", "export the scene again with its buffers");
  }
  const auto length = buffer["byteLength"].get<std::uint64_t>();
  if (bytes.size() < length) {
    context.fail(where, fmt::format("must have {} bytes, but there are {}", length, bytes.size()),
                 "the file is cut off or belongs to another scene");
  }
  return bytes.first(length);
}

std::span<const std::byte> GltfBuffers::range(std::size_t buffer, std::uint64_t offset, std::uint64_t length,
                                              const std::string& where, const GltfContext& context) const {
  const std::span<const std::byte> bytes = bytes_[buffer];
  const auto end = sum_of(offset, length, 1);
  if (!end || *end > bytes.size()) {
    context.fail(where,
                 fmt::format("{} bytes at {} leave buffer {}, which has {}", length, offset, buffer, bytes.size()));
  }
  return bytes.subspan(offset, length);
}

namespace {

std::size_t component_bytes(int component_type) {
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return 1;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return 2;
    default:
      return 4;
  }
}

/// Columns and rows of a type; vectors are one column.
struct Shape {
  std::size_t columns = 1;
  std::size_t rows = 1;
};

Shape shape_of(int type) {
  switch (type) {
    case TINYGLTF_TYPE_VEC2:
      return {1, 2};
    case TINYGLTF_TYPE_VEC3:
      return {1, 3};
    case TINYGLTF_TYPE_VEC4:
      return {1, 4};
    case TINYGLTF_TYPE_MAT2:
      return {2, 2};
    case TINYGLTF_TYPE_MAT3:
      return {3, 3};
    case TINYGLTF_TYPE_MAT4:
      return {4, 4};
    default:
      return {1, 1};
  }
}

/// Bytes of one element; columns of matrices start at multiples of four (glTF 2.0, section 3.6.2.4).
std::size_t element_bytes(int type, int component_type) {
  const Shape shape = shape_of(type);
  const std::size_t column = shape.rows * component_bytes(component_type);
  return shape.columns == 1 ? column : shape.columns * ((column + 3) / 4 * 4);
}

template <typename Component>
float to_float(Component value, bool normalized) {
  if constexpr (std::is_floating_point_v<Component>) {
    return value;
  } else {
    const auto number = static_cast<float>(value);
    if (!normalized) return number;
    return std::max(number / static_cast<float>(std::numeric_limits<Component>::max()), -1.0F);
  }
}

template <typename Component, typename Out, typename Convert>
void convert_elements(const std::byte* from, std::size_t stride, std::size_t count, std::size_t width, Out* out,
                      const Convert& convert) {
  for (std::size_t i = 0; i < count; ++i, from += stride) {
    for (std::size_t j = 0; j < width; ++j) {
      Component value;
      std::memcpy(&value, from + j * sizeof(Component), sizeof(Component));
      *out++ = convert(value);
    }
  }
}

/// Elements of `width` components, `stride` bytes apart, as float.
void to_floats(int component_type, bool normalized, const std::byte* from, std::size_t stride, std::size_t count,
               std::size_t width, float* out) {
  if (component_type == TINYGLTF_COMPONENT_TYPE_FLOAT && stride == width * sizeof(float)) {
    std::memcpy(out, from, count * stride);
    return;
  }
  visit_component(component_type, [&]<typename Component>(Component) {
    convert_elements<Component>(from, stride, count, width, out,
                                [&](Component value) { return to_float(value, normalized); });
  });
}

void to_integers(int component_type, const std::byte* from, std::size_t stride, std::size_t count, std::size_t width,
                 std::uint32_t* out) {
  const auto run = [&]<typename Component>(Component) {
    convert_elements<Component>(from, stride, count, width, out,
                                [](Component value) { return static_cast<std::uint32_t>(value); });
  };
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return run(std::uint8_t{});
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return run(std::uint16_t{});
    default:
      HPR_CHECK(component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT);
      return run(std::uint32_t{});
  }
}

bool is_unsigned(int component_type) {
  return component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE ||
         component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
         component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
}

}  // namespace

tinygltf::Model parse_model(Json root, const GltfContext& context) {
  root.erase("buffers");
  root.erase("images");
  root.erase("animations");
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

void GltfElements::read(std::size_t first, std::size_t count, float* out) const {
  const std::byte* const from = data + first * stride;
  if (count == 1 && component_type == TINYGLTF_COMPONENT_TYPE_FLOAT) {
    std::memcpy(out, from, width * sizeof(float));
  } else {
    to_floats(component_type, normalized, from, stride, count, width, out);
  }
}

void GltfElements::read(std::size_t first, std::size_t count, std::uint32_t* out) const {
  to_integers(component_type, data + first * stride, stride, count, width, out);
}

GltfData::GltfData(const tinygltf::Model& model, const GltfBuffers& buffers, GltfContext& context)
    : model_(&model), buffers_(&buffers), context_(&context) {
  for (std::size_t i = 0; i < model.bufferViews.size(); ++i) {
    // One warning of a buffer that could not be loaded is enough.
    const std::size_t buffer = to_size(model.bufferViews[i].buffer);
    if (buffer >= buffers.size() || buffers[buffer].empty()) continue;
    context.check_entry("bufferViews", i, [&] { check_view(i); });
  }
  for (std::size_t i = 0; i < model.accessors.size(); ++i) {
    context.check_entry("accessors", i, [&] { check_accessor(i); });
  }
}

void GltfData::check_view(std::size_t index) const {
  const tinygltf::BufferView& view = model_->bufferViews[index];
  const std::size_t buffer = to_size(view.buffer);
  const std::string where = fmt::format("bufferViews[{}]", index);
  if (buffer >= buffers_->size()) context_->fail(where, fmt::format("there is no buffer {}", view.buffer));
  (void)buffers_->range(buffer, view.byteOffset, view.byteLength, where, *context_);
}

void GltfData::check_accessor(std::size_t index) const {
  const tinygltf::Accessor& accessor = model_->accessors[index];
  const std::string where = fmt::format("accessors[{}]", index);
  if (accessor.sparse.isSparse) check_sparse(accessor, where);
  if (accessor.bufferView < 0) {
    // Zeros cost nothing in the file, so nothing but this bounds them.
    constexpr std::size_t kMaxZeros = std::size_t{1} << 26;
    if (accessor.count > kMaxZeros) {
      context_->fail(where, fmt::format("{} elements without a bufferView", accessor.count),
                     "give the accessor data of its own", ExitCode::Limit);
    }
    return;
  }
  const tinygltf::BufferView& view = model_->bufferViews[to_size(accessor.bufferView)];
  const std::size_t size = element_bytes(accessor.type, accessor.componentType);
  const std::size_t stride = view.byteStride == 0 ? size : view.byteStride;
  if (stride < size) {
    context_->fail(where, fmt::format("elements of {} bytes stand {} bytes apart in bufferView {}", size, stride,
                                      accessor.bufferView));
  }
  const auto last = sum_of(accessor.byteOffset, accessor.count - 1, stride);
  const auto end = last ? sum_of(*last, size, 1) : std::nullopt;
  if (!end || *end > view.byteLength) {
    context_->fail(where, fmt::format("{} elements of {} bytes at {} leave bufferView {}, which has {} bytes",
                                      accessor.count, size, accessor.byteOffset, accessor.bufferView, view.byteLength));
  }
  if ((view.byteOffset + accessor.byteOffset) % component_bytes(accessor.componentType) != 0) {
    context_->warn(where, "is not aligned to its component type");
  }
}

void GltfData::check_sparse(const tinygltf::Accessor& accessor, const std::string& where) const {
  const auto& sparse = accessor.sparse;
  if (to_size(sparse.count) > accessor.count) {
    context_->fail(where, fmt::format("replaces {} of {} elements", sparse.count, accessor.count));
  }
  if (!is_unsigned(sparse.indices.componentType)) {
    context_->fail(where + ".sparse.indices", "must be unsigned integers");
  }
  const auto check = [&](int view, int offset, std::size_t size, const char* part) {
    const std::size_t length = model_->bufferViews[to_size(view)].byteLength;
    const auto end = sum_of(to_size(offset), to_size(sparse.count), size);
    if (!end || *end > length) {
      context_->fail(fmt::format("{}.sparse.{}", where, part),
                     fmt::format("{} elements of {} bytes at {} leave bufferView {}, which has {} bytes", sparse.count,
                                 size, offset, view, length));
    }
  };
  check(sparse.indices.bufferView, sparse.indices.byteOffset, component_bytes(sparse.indices.componentType), "indices");
  check(sparse.values.bufferView, sparse.values.byteOffset, element_bytes(accessor.type, accessor.componentType),
        "values");
}

std::span<const std::byte> GltfData::view(int index) const {
  if (!context_->is_used("bufferViews", to_size(index))) check_view(to_size(index));  // it may be wrong
  const tinygltf::BufferView& view = model_->bufferViews[to_size(index)];
  return (*buffers_)[to_size(view.buffer)].subspan(view.byteOffset, view.byteLength);
}

void GltfData::require_type(int index, std::initializer_list<int> types, const std::string& where) const {
  if (std::ranges::find(types, accessor(index).type) == types.end()) {
    context_->fail(where, fmt::format("accessor {} has the wrong type for it", index));
  }
}

std::vector<std::uint32_t> GltfData::sparse_targets(int index) const {
  const tinygltf::Accessor& from = accessor(index);
  const auto& indices = from.sparse.indices;
  std::vector<std::uint32_t> targets(to_size(from.sparse.count));
  const std::byte* const data = view(indices.bufferView).data() + indices.byteOffset;
  to_integers(indices.componentType, data, component_bytes(indices.componentType), targets.size(), 1, targets.data());
  for (const std::uint32_t target : targets) {
    if (target >= from.count) {
      context_->fail(fmt::format("accessors[{}].sparse.indices", index),
                     fmt::format("{} is past its {} elements", target, from.count));
    }
  }
  if (!std::ranges::is_sorted(targets, std::ranges::less_equal{})) {
    context_->warn(fmt::format("accessors[{}].sparse.indices", index), "do not ascend");
  }
  return targets;
}

void GltfData::read_floats(int index, float* out, std::size_t width) const {
  HPR_CHECK(context_->is_used("accessors", to_size(index)));
  const tinygltf::Accessor& from = accessor(index);
  const Shape shape = shape_of(from.type);
  HPR_CHECK(shape.columns * shape.rows == width);
  // Only matrices of floats are read, and those have no padding.
  HPR_CHECK(shape.columns == 1 || from.componentType == TINYGLTF_COMPONENT_TYPE_FLOAT);
  const std::size_t size = element_bytes(from.type, from.componentType);
  if (from.bufferView >= 0) {
    const std::size_t stride = model_->bufferViews[to_size(from.bufferView)].byteStride;
    to_floats(from.componentType, from.normalized, view(from.bufferView).data() + from.byteOffset,
              stride == 0 ? size : stride, from.count, width, out);
  }
  if (!from.sparse.isSparse || from.sparse.count == 0) return;
  const std::byte* value = view(from.sparse.values.bufferView).data() + from.sparse.values.byteOffset;
  for (const std::uint32_t target : sparse_targets(index)) {
    to_floats(from.componentType, from.normalized, value, size, 1, width, out + target * width);
    value += size;
  }
}

GltfElements GltfData::elements(int index) const {
  HPR_CHECK(context_->is_used("accessors", to_size(index)));
  const tinygltf::Accessor& from = accessor(index);
  HPR_CHECK(from.bufferView >= 0 && !from.sparse.isSparse);
  const Shape shape = shape_of(from.type);
  HPR_CHECK(shape.columns == 1);
  const std::size_t stride = model_->bufferViews[to_size(from.bufferView)].byteStride;
  return {view(from.bufferView).data() + from.byteOffset,
          stride == 0 ? element_bytes(from.type, from.componentType) : stride, shape.rows, from.componentType,
          from.normalized};
}

void GltfData::forget_after(std::size_t bytes) const {
  constexpr std::size_t kMuch = std::size_t{4} << 20U;
  if (bytes >= kMuch && context_->reads_in_parts()) forget();
}

std::vector<std::uint32_t> GltfData::integers(int index) const {
  HPR_CHECK(context_->is_used("accessors", to_size(index)));
  const tinygltf::Accessor& from = accessor(index);
  HPR_CHECK(is_unsigned(from.componentType));
  const std::size_t width = shape_of(from.type).rows;
  context_->charge(from.count * width * sizeof(std::uint32_t), "an accessor");
  std::vector<std::uint32_t> values(from.count * width);
  const std::size_t size = element_bytes(from.type, from.componentType);
  if (from.bufferView >= 0) {
    const std::size_t stride = model_->bufferViews[to_size(from.bufferView)].byteStride;
    to_integers(from.componentType, view(from.bufferView).data() + from.byteOffset, stride == 0 ? size : stride,
                from.count, width, values.data());
  }
  forget_after(values.size() * sizeof(std::uint32_t));
  if (!from.sparse.isSparse || from.sparse.count == 0) return values;
  const std::byte* value = view(from.sparse.values.bufferView).data() + from.sparse.values.byteOffset;
  for (const std::uint32_t target : sparse_targets(index)) {
    to_integers(from.componentType, value, size, 1, width, values.data() + target * width);
    value += size;
  }
  return values;
}

}  // namespace hpr
