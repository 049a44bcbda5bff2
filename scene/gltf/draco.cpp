#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>
#include <draco/core/varint_decoding.h>
#include <draco/metadata/metadata_decoder.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>

#include "core/text.h"
#include "scene/gltf/compression.h"

namespace hpr {
namespace {

constexpr const char* kDraco = "KHR_draco_mesh_compression";

/// What a Draco mesh says of itself before its first triangle.
struct DracoCounts {
  bool sequential = false;
  std::uint64_t faces = 0;
  std::uint64_t vertices = 0;   ///< at most as many as points; of a sequential mesh exactly
  std::uint64_t seam_sets = 0;  ///< attribute groups with a connectivity of their own
};

/// Of the Draco bitstream 2.2, sections "Draco decode" to "Connectivity header". None where the bytes are none.
std::optional<DracoCounts> read_counts(draco::DecoderBuffer buffer) {
  draco::DracoHeader header;
  if (!draco::PointCloudDecoder::DecodeHeader(&buffer, &header).ok()) return std::nullopt;
  if (header.encoder_type != draco::TRIANGULAR_MESH || header.version_major != 2 || header.version_minor != 2) {
    return std::nullopt;
  }
  buffer.set_bitstream_version(DRACO_BITSTREAM_VERSION(2, 2));
  constexpr unsigned kHasMetadata = 0x8000;
  if ((header.flags & kHasMetadata) != 0) {
    draco::GeometryMetadata metadata;
    if (!draco::MetadataDecoder().DecodeGeometryMetadata(&buffer, &metadata)) return std::nullopt;
  }
  DracoCounts counts;
  std::uint32_t faces = 0;
  std::uint32_t vertices = 0;
  std::uint8_t traversal = 0;
  std::uint8_t seam_sets = 0;
  counts.sequential = header.encoder_method == draco::MESH_SEQUENTIAL_ENCODING;
  if (counts.sequential) {
    if (!draco::DecodeVarint(&faces, &buffer) || !draco::DecodeVarint(&vertices, &buffer)) return std::nullopt;
  } else if (header.encoder_method != draco::MESH_EDGEBREAKER_ENCODING || !buffer.Decode(&traversal) ||
             !draco::DecodeVarint(&vertices, &buffer) || !draco::DecodeVarint(&faces, &buffer) ||
             !buffer.Decode(&seam_sets)) {
    return std::nullopt;
  }
  counts.faces = faces;
  counts.vertices = vertices;
  counts.seam_sets = seam_sets;
  return counts;
}

/// What the decoder allocates for triangles, at most: corner tables of 24 bytes a corner, and for each attribute with
/// seams another of 20.
std::uint64_t connectivity_bytes(const DracoCounts& counts) {
  return counts.faces * (128 + 64 * counts.seam_sets) + counts.vertices * 16;
}

/// What the decoder allocates for the attributes that are declared so far, at most: integers, what they become, and an
/// index for each point.
std::uint64_t attribute_bytes(const draco::PointCloud& cloud) {
  std::uint64_t bytes_a_point = 0;
  for (int i = 0; i < cloud.num_attributes(); ++i) {
    const draco::PointAttribute& attribute = *cloud.attribute(i);
    const auto component = static_cast<std::uint64_t>(std::max(draco::DataTypeLength(attribute.data_type()), 1));
    bytes_a_point += std::uint64_t{attribute.num_components()} * (2 * sizeof(std::int32_t) + component) + 16;
  }
  return std::uint64_t{cloud.num_points()} * bytes_a_point;
}

/// A decoder of Draco's that ends before the values of attributes, which a few bytes may declare by the thousand, where
/// these would take more than `room` bytes.
template <typename Decoder>
class BoundedDecoder : public Decoder {
 public:
  explicit BoundedDecoder(std::uint64_t room) : room_(room) {}
  [[nodiscard]] bool past_room() const { return past_room_; }

 protected:
  bool DecodeAllAttributes() override {
    past_room_ = attribute_bytes(*this->point_cloud()) > room_;
    return !past_room_ && Decoder::DecodeAllAttributes();
  }

 private:
  std::uint64_t room_;
  bool past_room_ = false;
};

template <typename Decoder>
std::unique_ptr<draco::Mesh> decode_mesh(draco::DecoderBuffer buffer, const std::string& where,
                                         const GltfContext& context) {
  BoundedDecoder<Decoder> decoder(context.memory_left());
  auto mesh = std::make_unique<draco::Mesh>();
  std::string why;
  try {
    const draco::DecoderOptions options;
    const draco::Status status = decoder.Decode(options, &buffer, mesh.get());
    if (status.ok()) return mesh;
    why = status.error_msg_string();
  } catch (const std::length_error& error) {
    why = error.what();
  }
  if (decoder.past_room()) context.check_room(attribute_bytes(*mesh), "a Draco mesh");
  context.fail(where, fmt::format("the Draco data are broken: {}", printable(why, 100)));
}

/// The components of a type of accessors; 0 for matrices.
std::size_t width_of(const std::string& type) {
  constexpr std::array kTypes{"SCALAR", "VEC2", "VEC3", "VEC4"};
  const auto found = std::ranges::find(kTypes, type);
  return found == kTypes.end() ? 0 : static_cast<std::size_t>(found - kTypes.begin()) + 1;
}

/// Whether all points have a value inside of the attribute's memory.
bool is_complete(const draco::PointAttribute& attribute, std::size_t points) {
  const draco::DataBuffer* const buffer = attribute.buffer();
  if (buffer == nullptr || attribute.byte_stride() <= 0 || attribute.byte_offset() < 0) return false;
  const auto stride = static_cast<std::size_t>(attribute.byte_stride());
  const auto offset = static_cast<std::size_t>(attribute.byte_offset());
  if (buffer->data_size() < offset) return false;
  const std::size_t values = std::min(attribute.size(), (buffer->data_size() - offset) / stride);
  if (attribute.is_mapping_identity()) return points <= values;
  if (attribute.indices_map_size() < points) return false;
  for (std::size_t i = 0; i < points; ++i) {
    if (attribute.mapped_index(draco::PointIndex(static_cast<std::uint32_t>(i))).value() >= values) return false;
  }
  return true;
}

template <typename Component>
bool convert_to(const draco::PointAttribute& attribute, std::size_t points, std::span<std::byte> out) {
  const std::size_t width = attribute.num_components();
  std::array<Component, 4> values{};
  for (std::size_t i = 0; i < points; ++i) {
    const draco::PointIndex point(static_cast<std::uint32_t>(i));
    if (!attribute.ConvertValue<Component>(attribute.mapped_index(point), values.data())) return false;
    std::memcpy(out.data() + i * width * sizeof(Component), values.data(), width * sizeof(Component));
  }
  return true;
}

/// The attribute's values, `width` components each, as an accessor of that component type has them. None where Draco's
/// do not fit into it.
std::optional<std::vector<std::byte>> values_of(const draco::PointAttribute& attribute, std::size_t points,
                                                int component_type) {
  return visit_component(component_type, [&]<typename Component>(Component) -> std::optional<std::vector<std::byte>> {
    std::vector<std::byte> out(points * attribute.num_components() * sizeof(Component));
    if (!convert_to<Component>(attribute, points, out)) return std::nullopt;
    return out;
  });
}

struct CompressedPrimitive {
  Json* json = nullptr;
  std::string where;
};

/// All primitives of one Draco mesh, which is decoded once.
class DracoView {
 public:
  DracoView(std::size_t view, Json& root, GltfBuffers& buffers, GltfContext& context)
      : where_(fmt::format("bufferViews[{}]", view)), root_(root), buffers_(buffers), context_(context) {
    const Json& from = root["bufferViews"][view];
    const auto bytes = buffers.range(from["buffer"].get<std::size_t>(), from.value("byteOffset", std::uint64_t{0}),
                                     from["byteLength"].get<std::uint64_t>(), where_, context);
    buffer_.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    const auto counts = read_counts(buffer_);
    if (!counts) context.fail(where_, "is no triangle mesh of Draco 2.2");
    counts_ = *counts;
  }

  void decode_for(const std::vector<CompressedPrimitive>& primitives) {
    for (const CompressedPrimitive& primitive : primitives) check_counts(primitive);
    context_.check_room(connectivity_bytes(counts_), "a Draco mesh");
    mesh_ = counts_.sequential ? decode_mesh<draco::MeshSequentialDecoder>(buffer_, where_, context_)
                               : decode_mesh<draco::MeshEdgebreakerDecoder>(buffer_, where_, context_);
    for (const CompressedPrimitive& primitive : primitives) fill(primitive);
  }

 private:
  [[nodiscard]] static bool is_strip(const CompressedPrimitive& primitive) {
    return primitive.json->value("mode", TINYGLTF_MODE_TRIANGLES) == TINYGLTF_MODE_TRIANGLE_STRIP;
  }

  /// What the header says, so that no more is decoded than the document declares.
  void check_counts(const CompressedPrimitive& primitive) const {
    if (!is_strip(primitive) && primitive.json->value("mode", TINYGLTF_MODE_TRIANGLES) != TINYGLTF_MODE_TRIANGLES) {
      context_.fail(primitive.where, "only triangles and triangle strips are compressed with Draco");
    }
    const Json& primitives = *primitive.json;
    const Json* const indices = primitives.find("indices");
    if (indices != nullptr && !is_strip(primitive)) {
      const auto declared = accessor(indices->get<std::size_t>())["count"].get<std::uint64_t>();
      if (declared != counts_.faces * 3) {
        context_.fail(primitive.where + ".indices",
                      fmt::format("has {} elements, but the Draco mesh has {} triangles", declared, counts_.faces));
      }
    }
    for (const auto& [name, id] : primitives["extensions"][kDraco]["attributes"].members()) {
      const Json* const index = primitives["attributes"].find(name);
      if (index == nullptr) continue;
      const auto declared = accessor(index->get<std::size_t>())["count"].get<std::uint64_t>();
      if (counts_.vertices > declared) fail_points(primitive, name, declared, counts_.vertices);
    }
  }

  [[noreturn]] void fail_points(const CompressedPrimitive& primitive, const std::string& name, std::uint64_t declared,
                                std::uint64_t points) const {
    context_.fail(fmt::format("{}.attributes.{}", primitive.where, printable(name)),
                  fmt::format("has {} elements, but the Draco mesh has {} points", declared, points));
  }

  [[nodiscard]] const Json& accessor(std::size_t index) const { return root_["accessors"][index]; }

  void fill(const CompressedPrimitive& primitive) {
    Json& json = *primitive.json;
    const Json attributes = json["extensions"][kDraco]["attributes"];
    for (const auto& [name, id] : attributes.members()) {
      if (!json["attributes"].contains(name)) {
        context_.warn(primitive.where, fmt::format("{} is compressed, but no attribute", printable(name)));
        continue;
      }
      Json& index = json["attributes"][name];
      index = filled(primitive, name, index.get<std::size_t>(), id.get<std::uint32_t>());
    }
    json["indices"] = triangles(primitive);
    json["mode"] = TINYGLTF_MODE_TRIANGLES;  // also of strips, whose triangles are decoded
    json["extensions"].erase(kDraco);
  }

  /// The accessor with the values of the attribute `id` in the manner of accessor `declared`.
  std::size_t filled(const CompressedPrimitive& primitive, const std::string& name, std::size_t declared,
                     std::uint32_t id) {
    const std::pair key{declared, id};
    if (const auto known = filled_.find(key); known != filled_.end()) return known->second;
    const std::string where = fmt::format("{}.attributes.{}", primitive.where, printable(name));
    const draco::PointAttribute* const attribute = mesh_->GetAttributeByUniqueId(id);
    if (attribute == nullptr) context_.fail(where, fmt::format("the Draco mesh has no attribute {}", id));
    Json described = accessor(declared);
    const auto count = described["count"].get<std::uint64_t>();
    if (count != mesh_->num_points()) fail_points(primitive, name, count, mesh_->num_points());
    const std::size_t width = width_of(described["type"].string());
    if (width != attribute->num_components()) {
      context_.fail(where, fmt::format("is {}, but the Draco mesh has {} components", described["type"].string(),
                                       attribute->num_components()));
    }
    if (!is_complete(*attribute, count)) context_.fail(where, "the Draco mesh lacks values");
    context_.charge(count * width * sizeof(float), "a Draco mesh");
    auto values = values_of(*attribute, count, described["componentType"].get<int>());
    if (!values) context_.fail(where, "the values of the Draco mesh do not fit into its componentType");
    // An accessor without bytes exists for this mesh alone; one that has some may be read elsewhere.
    const bool in_place = !described.contains("bufferView");
    described["bufferView"] = add_view(*std::move(values));
    described.erase("byteOffset");
    const std::size_t made = in_place ? declared : root_["accessors"].size();
    if (in_place) {
      root_["accessors"][declared] = std::move(described);
    } else {
      root_["accessors"].push_back(std::move(described));
    }
    filled_[key] = made;
    return made;
  }

  /// The accessor with the indices of all triangles.
  std::size_t triangles(const CompressedPrimitive& primitive) {
    if (triangles_) return *triangles_;
    const std::size_t faces = mesh_->num_faces();
    if (faces == 0) context_.fail(primitive.where, "the Draco mesh has no triangles");
    context_.charge(faces * 3 * sizeof(std::uint32_t), "a Draco mesh");
    std::vector<std::byte> bytes(faces * 3 * sizeof(std::uint32_t));
    for (std::size_t i = 0; i < faces; ++i) {
      const draco::Mesh::Face& face = mesh_->face(draco::FaceIndex(static_cast<std::uint32_t>(i)));
      const std::array<std::uint32_t, 3> corners{face[0].value(), face[1].value(), face[2].value()};
      std::memcpy(bytes.data() + i * sizeof(corners), corners.data(), sizeof(corners));
    }
    triangles_ = root_["accessors"].size();
    root_["accessors"].push_back({{"bufferView", add_view(std::move(bytes))},
                                  {"componentType", TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT},
                                  {"count", faces * 3},
                                  {"type", "SCALAR"}});
    return *triangles_;
  }

  std::size_t add_view(std::vector<std::byte> bytes) {
    const std::size_t length = bytes.size();
    root_["bufferViews"].push_back({{"buffer", buffers_.add(std::move(bytes))}, {"byteLength", length}});
    return root_["bufferViews"].size() - 1;
  }

  std::string where_;
  Json& root_;
  GltfBuffers& buffers_;
  GltfContext& context_;
  draco::DecoderBuffer buffer_;
  DracoCounts counts_;
  std::unique_ptr<draco::Mesh> mesh_;
  std::map<std::pair<std::size_t, std::uint32_t>, std::size_t> filled_;
  std::optional<std::size_t> triangles_;
};

}  // namespace

void decode_draco_primitives(Json& root, GltfBuffers& buffers, GltfContext& context) {
  Json* const meshes = root.find("meshes");
  if (meshes == nullptr) return;
  std::map<std::size_t, std::vector<CompressedPrimitive>> views;
  for (std::size_t m = 0; m < meshes->size(); ++m) {
    if (!context.is_used("meshes", m)) continue;
    Json& primitives = (*meshes)[m]["primitives"];
    for (std::size_t p = 0; p < primitives.size(); ++p) {
      Json& primitive = primitives[p];
      const Json& extension = std::as_const(primitive)["extensions"][kDraco];
      if (!extension.is_object()) continue;
      views[extension["bufferView"].get<std::size_t>()].push_back(
          {&primitive, fmt::format("meshes[{}].primitives[{}]", m, p)});
    }
  }
  // No member is added to the document itself, which would move its meshes.
  for (const auto& [view, primitives] : views) DracoView(view, root, buffers, context).decode_for(primitives);
}

}  // namespace hpr
