#include "scene/gltf/buffers.h"

#include <fmt/format.h>

#include <algorithm>

#include "scene/gltf/uri.h"

namespace hpr {

std::vector<std::byte> GltfBuffers::resolve(const std::string& uri, const std::string& where,
                                            GltfContext& context) const {
  const std::string what = fmt::format("{}: {}", context.name(), where);
  if (is_data_uri(uri)) {
    context.charge(uri.size() / 4 * 3, "a data URI");
    return data_uri_bytes(uri, what);
  }
  std::vector<std::byte> bytes =
      read_jailed(folder_, uri, what, std::min(context.limits().file_bytes, context.memory_left()));
  context.charge(bytes.size(), "a file");
  return bytes;
}

void GltfBuffers::load(const Json& root, GltfContext& context) {
  const Json* const found = root.find("buffers");
  if (found == nullptr) return;
  owned_.resize(found->size());
  for (std::size_t i = 0; i < found->size(); ++i) {
    const Json& buffer = (*found)[i];
    const std::string where = fmt::format("buffers[{}]", i);
    std::span<const std::byte> bytes;
    if (buffer.contains("uri")) {
      const auto uri = buffer["uri"].get<std::string>();
      if (uri.starts_with("data:image/")) context.warn(where, "its data URI says that it is a picture");
      owned_[i] = resolve(uri, where, context);
      bytes = owned_[i];
    } else if (i == 0 && parts_->has_binary) {
      bytes = parts_->binary;
    } else {
      context.fail(where, "has neither a uri nor a BIN chunk", "export the scene again with its buffers");
    }
    const auto length = buffer["byteLength"].get<std::uint64_t>();
    if (bytes.size() < length) {
      context.fail(where, fmt::format("must have {} bytes, but there are {}", length, bytes.size()),
                   "the file is cut off or belongs to another scene");
    }
    bytes_.push_back(bytes.first(length));
  }
}

}  // namespace hpr
