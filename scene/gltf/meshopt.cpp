#include <fmt/format.h>
#include <meshoptimizer.h>

#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "core/text.h"
#include "scene/gltf/compression.h"

namespace hpr {
namespace {

constexpr const char* kMeshopt = "EXT_meshopt_compression";

enum class Mode { Attributes, Triangles, Indices };
enum class Filter { None, Octahedral, Quaternion, Exponential };

/// A compressed view, as the document describes it.
struct CompressedView {
  std::span<const std::byte> bytes;
  std::size_t count = 0;
  std::size_t stride = 0;
  Mode mode = Mode::Attributes;
  Filter filter = Filter::None;
};

template <typename Value, std::size_t N>
Value named_in(const std::array<std::pair<std::string_view, Value>, N>& values, const std::string& name,
               const std::string& where, const GltfContext& context) {
  const auto found = std::ranges::find(values, name, [](const auto& value) { return value.first; });
  if (found == values.end()) context.fail(where, fmt::format("is \"{}\", which HPR does not know", printable(name)));
  return found->second;
}

/// Of the extension EXT_meshopt_compression, section "JSON schema updates".
void check_layout(const CompressedView& view, const std::string& where, const GltfContext& context) {
  const auto require = [&](bool good, std::string_view what) {
    if (!good) context.fail(where, what);
  };
  if (view.mode == Mode::Attributes) {
    require(view.stride % 4 == 0, fmt::format("attributes of {} bytes, not a multiple of 4", view.stride));
  } else {
    require(view.stride == 2 || view.stride == 4, fmt::format("indices of {} bytes, neither 2 nor 4", view.stride));
    require(view.filter == Filter::None, "indices have no filter");
    require(view.mode == Mode::Indices || view.count % 3 == 0,
            fmt::format("{} indices make no whole number of triangles", view.count));
  }
  if (view.filter == Filter::Octahedral) {
    require(view.stride == 4 || view.stride == 8,
            fmt::format("octahedral vectors of {} bytes, neither 4 nor 8", view.stride));
  }
  if (view.filter == Filter::Quaternion) {
    require(view.stride == 8, fmt::format("quaternions of {} bytes, not 8", view.stride));
  }
}

/// What the shortest encoding of so many elements takes: of attributes two bits for 16 bytes, of triangles and of
/// single indices a byte each.
std::size_t min_bytes(const CompressedView& view) {
  if (view.mode == Mode::Attributes) return view.count / 64 * view.stride;
  return view.mode == Mode::Triangles ? view.count / 3 : view.count;
}

/// Fills `out`, count * stride bytes. False where the bytes are no such encoding.
bool decode(const CompressedView& view, std::span<std::byte> out) {
  const auto* const from = reinterpret_cast<const unsigned char*>(view.bytes.data());
  switch (view.mode) {
    case Mode::Attributes:
      return meshopt_decodeVertexBuffer(out.data(), view.count, view.stride, from, view.bytes.size()) == 0;
    case Mode::Triangles:
      return meshopt_decodeIndexBuffer(out.data(), view.count, view.stride, from, view.bytes.size()) == 0;
    default:
      return meshopt_decodeIndexSequence(out.data(), view.count, view.stride, from, view.bytes.size()) == 0;
  }
}

void apply_filter(const CompressedView& view, std::span<std::byte> out) {
  switch (view.filter) {
    case Filter::Octahedral:
      return meshopt_decodeFilterOct(out.data(), view.count, view.stride);
    case Filter::Quaternion:
      return meshopt_decodeFilterQuat(out.data(), view.count, view.stride);
    case Filter::Exponential:
      return meshopt_decodeFilterExp(out.data(), view.count, view.stride);
    default:
      return;
  }
}

CompressedView describe(const Json& extension, const GltfBuffers& buffers, const std::string& where,
                        const GltfContext& context) {
  constexpr std::array kModes{std::pair<std::string_view, Mode>{"ATTRIBUTES", Mode::Attributes},
                              std::pair<std::string_view, Mode>{"TRIANGLES", Mode::Triangles},
                              std::pair<std::string_view, Mode>{"INDICES", Mode::Indices}};
  constexpr std::array kFilters{std::pair<std::string_view, Filter>{"NONE", Filter::None},
                                std::pair<std::string_view, Filter>{"OCTAHEDRAL", Filter::Octahedral},
                                std::pair<std::string_view, Filter>{"QUATERNION", Filter::Quaternion},
                                std::pair<std::string_view, Filter>{"EXPONENTIAL", Filter::Exponential}};
  CompressedView view;
  view.bytes = buffers.range(extension["buffer"].get<std::size_t>(), extension.value("byteOffset", std::uint64_t{0}),
                             extension["byteLength"].get<std::uint64_t>(), where, context);
  view.count = extension["count"].get<std::size_t>();
  view.stride = extension["byteStride"].get<std::size_t>();
  view.mode = named_in(kModes, extension["mode"].string(), where + ".mode", context);
  view.filter =
      named_in(kFilters, extension.value("filter", std::string(kFilters.front().first)), where + ".filter", context);
  return view;
}

/// The view's content. `length` is what the document says that it has.
std::vector<std::byte> content_of(const CompressedView& view, std::uint64_t length, const std::string& where,
                                  GltfContext& context) {
  check_layout(view, where, context);
  // Neither factor is more than 2^53 and 256.
  if (view.count * view.stride != length) {
    context.fail(where, fmt::format("{} elements of {} bytes are not the {} bytes of the view", view.count, view.stride,
                                    length));
  }
  if (view.bytes.size() < min_bytes(view)) {
    context.fail(where, fmt::format("{} bytes cannot hold {} elements", view.bytes.size(), view.count));
  }
  context.charge(length, "a compressed buffer view");
  std::vector<std::byte> out(length);
  if (!decode(view, out)) context.fail(where, "the compressed data are broken");
  apply_filter(view, out);
  return out;
}

}  // namespace

void decode_meshopt_views(Json& root, GltfBuffers& buffers, GltfContext& context) {
  Json* const views = root.find("bufferViews");
  if (views == nullptr) return;
  for (std::size_t i = 0; i < views->size(); ++i) {
    Json& view = (*views)[i];
    const Json& extension = std::as_const(view)["extensions"][kMeshopt];
    if (!extension.is_object() || !context.is_used("bufferViews", i)) continue;
    const std::string where = fmt::format("bufferViews[{}].{}", i, kMeshopt);
    const CompressedView described = describe(extension, buffers, where, context);
    if (const Json* const stride = view.find("byteStride"); stride && stride->get<std::size_t>() != described.stride) {
      context.fail(where, fmt::format("its byteStride is {}, that of the view {}", described.stride,
                                      stride->get<std::size_t>()));
    }
    const auto length = view["byteLength"].get<std::uint64_t>();
    view["buffer"] = buffers.add(content_of(described, length, where, context));
    view["byteOffset"] = 0;
    view["extensions"].erase(kMeshopt);
  }
}

}  // namespace hpr
