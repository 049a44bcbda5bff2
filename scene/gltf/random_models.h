#pragma once

#include <draco/compression/encode.h>
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/bytes.h"
#include "core/json.h"
#include "scene/scene.h"

/// Random models as plain glTF and as the same glTF compressed by the libraries' own encoders.
namespace hpr::test {

using Random = std::mt19937;

inline std::uint32_t random_below(Random& random, std::uint32_t end) {
  return static_cast<std::uint32_t>(random() % end);
}

inline float random_float(Random& random, float low, float high) {
  return low + (high - low) * static_cast<float>(random()) / static_cast<float>(Random::max());
}

/// What an accessor holds, without gaps.
struct Elements {
  int component_type = 5126;
  std::size_t width = 3;
  bool normalized = false;
  std::vector<std::byte> bytes = {};

  [[nodiscard]] std::size_t component_bytes() const {
    return component_type < 5122 ? 1 : component_type < 5125 ? 2 : 4;
  }
  [[nodiscard]] std::size_t element_bytes() const { return width * component_bytes(); }
  [[nodiscard]] std::size_t count() const { return bytes.size() / element_bytes(); }
  [[nodiscard]] std::string type() const { return width == 1 ? "SCALAR" : "VEC" + std::to_string(width); }
};

template <typename Component>
Elements elements_of(const std::vector<Component>& values, std::size_t width, int component_type, bool normalized) {
  const auto bytes = std::as_bytes(std::span(values));
  return {component_type, width, normalized, {bytes.begin(), bytes.end()}};
}

inline Elements floats_of(const std::vector<float>& values, std::size_t width) {
  return elements_of(values, width, 5126, false);
}

/// Unsigned integers of component type 5121, 5123 or 5125.
inline Elements integers_of(const std::vector<std::uint32_t>& values, std::size_t width, int component_type,
                            bool normalized) {
  if (component_type == 5125) return elements_of(values, width, component_type, normalized);
  if (component_type == 5123)
    return elements_of(std::vector<std::uint16_t>(values.begin(), values.end()), width, component_type, normalized);
  return elements_of(std::vector<std::uint8_t>(values.begin(), values.end()), width, component_type, normalized);
}

struct RandomPrimitive {
  std::map<std::string, Elements> attributes;
  std::vector<std::uint32_t> indices;
  int index_type = 5123;
};

struct RandomModel {
  std::vector<RandomPrimitive> primitives;
  bool repeats_first = false;  ///< a second material for the accessors of the first primitive
};

/// Vertices on a grid of unit cells, each within 0.3 of its corner, so that a vertex is known by its rounded x and y.
/// Triangles are of the grid, with holes, and some between any vertices; no two have the same corners, none is
/// degenerate. Some vertices stand twice, with coordinates of their own: seams.
inline RandomPrimitive random_primitive(Random& random, int index_type) {
  const std::uint32_t side = 2 + random_below(random, index_type == 5121 ? 12 : 24);
  std::vector<float> positions;
  for (std::uint32_t i = 0; i < side * side; ++i) {
    const std::uint32_t row = i / side;
    positions.push_back(static_cast<float>(i % side) + random_float(random, -0.3F, 0.3F));
    positions.push_back(static_cast<float>(row) + random_float(random, -0.3F, 0.3F));
    positions.push_back(random_float(random, -3.0F, 3.0F));
  }
  RandomPrimitive made;
  std::set<std::array<std::uint32_t, 3>> known;
  const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    std::array<std::uint32_t, 3> corners{a, b, c};
    std::ranges::sort(corners);
    if (corners[0] == corners[1] || corners[1] == corners[2] || !known.insert(corners).second) return;
    made.indices.insert(made.indices.end(), {a, b, c});
  };
  for (std::uint32_t i = 0; i + side < side * side; ++i) {
    if (i % side + 1 == side || (i > 0 && random() % 10 == 0)) continue;
    add(i, i + 1, i + side);
    add(i + 1, i + side + 1, i + side);
  }
  for (std::uint32_t i = 0; i < side; ++i) {
    add(random_below(random, side * side), random_below(random, side * side), random_below(random, side));
  }
  for (std::uint32_t i = 0; i < side; ++i) {
    std::uint32_t& corner = made.indices[random() % made.indices.size()];
    for (std::size_t axis = 0; axis < 3; ++axis) positions.push_back(positions[std::size_t{corner} * 3 + axis]);
    corner = static_cast<std::uint32_t>(positions.size() / 3 - 1);
  }
  made.index_type = index_type;
  made.attributes["POSITION"] = floats_of(positions, 3);
  return made;
}

inline std::vector<float> random_directions(Random& random, std::size_t count, bool with_sign) {
  std::vector<float> values;
  for (std::size_t i = 0; i < count; ++i) {
    glm::vec3 v(random_float(random, -1, 1), random_float(random, -1, 1), random_float(random, -1, 1));
    v = glm::normalize(v + glm::vec3(0, 0, glm::length(v) < 0.1F ? 1.0F : 0.0F));
    values.insert(values.end(), {v.x, v.y, v.z});
    if (with_sign) values.push_back(random() % 2 == 0 ? 1.0F : -1.0F);
  }
  return values;
}

inline void add_random_attributes(Random& random, RandomPrimitive& primitive) {
  const std::size_t count = primitive.attributes["POSITION"].count();
  const auto floats = [&](std::size_t width) {
    std::vector<float> values(count * width);
    for (float& value : values) value = random_float(random, 0.0F, 1.0F);
    return floats_of(values, width);
  };
  const auto integers = [&](std::size_t width, int component_type) {
    std::vector<std::uint32_t> values(count * width);
    for (std::uint32_t& value : values) value = random_below(random, component_type == 5121 ? 256 : 65536);
    return integers_of(values, width, component_type, true);
  };
  if (random() % 4 != 0) {
    primitive.attributes["NORMAL"] = floats_of(random_directions(random, count, false), 3);
    if (random() % 3 == 0) primitive.attributes["TANGENT"] = floats_of(random_directions(random, count, true), 4);
  }
  if (random() % 4 != 0) primitive.attributes["TEXCOORD_0"] = random() % 2 == 0 ? floats(2) : integers(2, 5123);
  if (random() % 4 == 0) primitive.attributes["TEXCOORD_1"] = floats(2);
  switch (random() % 6) {
    case 0:
      primitive.attributes["COLOR_0"] = floats(4);
      break;
    case 1:
      primitive.attributes["COLOR_0"] = integers(4, 5121);
      break;
    case 2:
      primitive.attributes["COLOR_0"] = integers(3, 5121);
      break;
    case 3:
      primitive.attributes["COLOR_0"] = integers(3, 5123);
      break;
    default:
      break;
  }
}

inline RandomModel random_model(std::uint32_t seed) {
  Random random(seed);
  RandomModel model;
  for (std::uint32_t i = 0; i < 1 + seed % 3; ++i) {
    constexpr std::array kIndexTypes{5121, 5123, 5125};
    model.primitives.push_back(random_primitive(random, kIndexTypes.at((seed + i) % 3)));
    add_random_attributes(random, model.primitives.back());
  }
  model.repeats_first = seed % 4 == 0;
  return model;
}

/// A document that grows around one buffer; two nodes hold its mesh.
class ModelWriter {
 public:
  Json json = Json::parse(R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
      "nodes": [{"mesh": 0, "name": "a"}, {"mesh": 0, "name": "b", "translation": [3, 0, -2],
                 "rotation": [0, 0.6, 0, 0.8], "scale": [2, 1, 1.5]}],
      "materials": [{"name": "one"}, {"name": "two"}],
      "meshes": [{"primitives": []}], "accessors": [], "bufferViews": [], "buffers": [{}]})");

  [[nodiscard]] std::size_t add_bytes(std::span<const std::byte> bytes) {
    bytes_.resize((bytes_.size() + 3) / 4 * 4);
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    return bytes_.size() - bytes.size();
  }

  std::size_t add_view(std::span<const std::byte> bytes) {
    const std::size_t offset = add_bytes(bytes);
    json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", offset}, {"byteLength", bytes.size()}});
    return json["bufferViews"].size() - 1;
  }

  /// An accessor without a view.
  std::size_t add_accessor(const Elements& elements, std::size_t count) {
    Json accessor{{"componentType", elements.component_type}, {"count", count}, {"type", elements.type()}};
    if (elements.normalized) accessor["normalized"] = true;
    json["accessors"].push_back(std::move(accessor));
    return json["accessors"].size() - 1;
  }

  std::size_t add_plain(const Elements& elements) {
    const std::size_t accessor = add_accessor(elements, elements.count());
    json["accessors"][accessor]["bufferView"] = add_view(elements.bytes);
    return accessor;
  }

  void require(const char* extension) {
    for (const char* key : {"extensionsUsed", "extensionsRequired"}) json[key].push_back(extension);
  }

  void add_primitive(Json primitive) { json["meshes"][0]["primitives"].push_back(std::move(primitive)); }
  Json& primitive(std::size_t index) { return json["meshes"][0]["primitives"][index]; }

  /// The document with its buffer as a data URI.
  [[nodiscard]] Json gltf() const {
    Json document = json;
    document["buffers"][0] = {{"byteLength", bytes_.size()},
                              {"uri", "data:application/octet-stream;base64," + base64(bytes_)}};
    return document;
  }

  /// The document as a binary file.
  [[nodiscard]] std::vector<std::byte> glb() const {
    Json document = json;
    document["buffers"][0] = {{"byteLength", bytes_.size()}};
    std::string text = document.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    std::vector<std::byte> binary = bytes_;
    binary.resize((binary.size() + 3) / 4 * 4);
    std::string file("glTF");
    const auto number = [&](std::size_t value) {
      const auto whole = static_cast<std::uint32_t>(value);
      file.append(reinterpret_cast<const char*>(&whole), sizeof(whole));
    };
    number(2);
    number(28 + text.size() + binary.size());
    number(text.size());
    file += "JSON" + text;
    number(binary.size());
    file.append("BIN\0", 4);
    file.append(reinterpret_cast<const char*>(binary.data()), binary.size());
    const auto bytes = std::as_bytes(std::span(file));
    return {bytes.begin(), bytes.end()};
  }

 private:
  std::vector<std::byte> bytes_;
};

/// Positions need the box around them.
inline void add_bounds(ModelWriter& writer, std::size_t accessor, const Elements& elements) {
  std::array<float, 3> low{INFINITY, INFINITY, INFINITY};
  std::array<float, 3> high{-INFINITY, -INFINITY, -INFINITY};
  for (std::size_t i = 0; i < elements.count() * 3; ++i) {
    float value = 0.0F;
    std::memcpy(&value, elements.bytes.data() + i * sizeof(float), sizeof(float));
    low.at(i % 3) = std::min(low.at(i % 3), value);
    high.at(i % 3) = std::max(high.at(i % 3), value);
  }
  writer.json["accessors"][accessor]["min"] = low;
  writer.json["accessors"][accessor]["max"] = high;
}

/// Primitive by primitive, `write` makes the JSON.
template <typename Write>
void write_primitives(ModelWriter& writer, const RandomModel& model, const Write& write) {
  for (const RandomPrimitive& primitive : model.primitives) {
    Json made = write(primitive);
    made["material"] = 0;
    writer.add_primitive(std::move(made));
  }
  if (!model.repeats_first) return;
  writer.add_primitive(writer.primitive(0));
  writer.primitive(model.primitives.size())["material"] = 1;
}

inline ModelWriter write_plain(const RandomModel& model) {
  ModelWriter writer;
  write_primitives(writer, model, [&](const RandomPrimitive& primitive) {
    Json made{{"attributes", Json::object()}};
    for (const auto& [name, elements] : primitive.attributes) {
      const std::size_t accessor = writer.add_plain(elements);
      made["attributes"][name] = accessor;
      if (name == "POSITION") add_bounds(writer, accessor, elements);
    }
    made["indices"] = writer.add_plain(integers_of(primitive.indices, 1, primitive.index_type, false));
    return made;
  });
  return writer;
}

struct MeshoptOptions {
  const char* index_mode = "TRIANGLES";
  std::size_t direction_bytes = 0;  ///< of a component of NORMAL and TANGENT with OCTAHEDRAL; 0: floats
  int mantissa_bits = 0;            ///< of other floats with EXPONENTIAL; 0: as they are
};

/// Adds a compressed view of `content`, whose uncompressed bytes belong to a buffer that is not there.
inline std::size_t add_meshopt_view(ModelWriter& writer, std::span<const std::byte> content, std::size_t stride,
                                    const char* mode, const char* filter) {
  const std::size_t count = content.size() / stride;
  std::vector<std::byte> packed;
  if (mode == std::string("ATTRIBUTES")) {
    packed.resize(meshopt_encodeVertexBufferBound(count, stride));
    packed.resize(meshopt_encodeVertexBuffer(reinterpret_cast<unsigned char*>(packed.data()), packed.size(),
                                             content.data(), count, stride));
  } else {
    std::vector<unsigned int> indices(count);
    for (std::size_t i = 0; i < count; ++i) std::memcpy(&indices[i], content.data() + i * stride, stride);
    packed.resize(
        std::max(meshopt_encodeIndexBufferBound(count, count), meshopt_encodeIndexSequenceBound(count, count)));
    auto* const out = reinterpret_cast<unsigned char*>(packed.data());
    packed.resize(mode == std::string("TRIANGLES")
                      ? meshopt_encodeIndexBuffer(out, packed.size(), indices.data(), count)
                      : meshopt_encodeIndexSequence(out, packed.size(), indices.data(), count));
  }
  const std::size_t offset = writer.add_bytes(packed);
  Json& buffers = writer.json["buffers"];
  if (buffers.size() < 2) {
    buffers.push_back({{"byteLength", 1}, {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}});
    writer.require("EXT_meshopt_compression");
  }
  Json extension{{"buffer", 0},          {"byteOffset", offset}, {"byteLength", packed.size()},
                 {"byteStride", stride}, {"count", count},       {"mode", mode}};
  if (filter != nullptr) extension["filter"] = filter;
  Json view{{"buffer", 1}, {"byteLength", content.size()}};
  if (mode == std::string("ATTRIBUTES")) view["byteStride"] = stride;
  view["extensions"]["EXT_meshopt_compression"] = std::move(extension);
  writer.json["bufferViews"].push_back(std::move(view));
  return writer.json["bufferViews"].size() - 1;
}

inline std::size_t add_meshopt(ModelWriter& writer, const std::string& name, Elements elements,
                               const MeshoptOptions& options) {
  const std::size_t count = elements.count();
  const bool direction = name == "NORMAL" || name == "TANGENT";
  if (direction && options.direction_bytes > 0) {
    std::vector<float> fours(count * 4, 0.0F);
    for (std::size_t i = 0; i < count; ++i) {
      std::memcpy(&fours[4 * i], elements.bytes.data() + i * elements.element_bytes(), elements.element_bytes());
    }
    const std::size_t stride = 4 * options.direction_bytes;
    std::vector<std::byte> content(count * stride);
    meshopt_encodeFilterOct(content.data(), count, stride, static_cast<int>(8 * options.direction_bytes), fours.data());
    elements.component_type = options.direction_bytes == 1 ? 5120 : 5122;
    elements.normalized = true;
    const std::size_t accessor = writer.add_accessor(elements, count);
    writer.json["accessors"][accessor]["bufferView"] =
        add_meshopt_view(writer, content, stride, "ATTRIBUTES", "OCTAHEDRAL");
    return accessor;
  }
  const std::size_t accessor = writer.add_accessor(elements, count);
  const std::size_t stride = (elements.element_bytes() + 3) / 4 * 4;
  std::vector<std::byte> content(count * stride);
  if (elements.component_type == 5126 && !direction && options.mantissa_bits > 0) {
    meshopt_encodeFilterExp(content.data(), count, stride, options.mantissa_bits,
                            reinterpret_cast<const float*>(elements.bytes.data()));
    writer.json["accessors"][accessor]["bufferView"] =
        add_meshopt_view(writer, content, stride, "ATTRIBUTES", "EXPONENTIAL");
    return accessor;
  }
  for (std::size_t i = 0; i < count; ++i) {
    std::memcpy(content.data() + i * stride, elements.bytes.data() + i * elements.element_bytes(),
                elements.element_bytes());
  }
  writer.json["accessors"][accessor]["bufferView"] =
      add_meshopt_view(writer, content, stride, "ATTRIBUTES", count % 2 == 0 ? "NONE" : nullptr);
  return accessor;
}

inline ModelWriter write_meshopt(const RandomModel& model, const MeshoptOptions& options) {
  ModelWriter writer;
  if (options.direction_bytes > 0) writer.require("KHR_mesh_quantization");
  write_primitives(writer, model, [&](const RandomPrimitive& primitive) {
    Json made{{"attributes", Json::object()}};
    for (const auto& [name, elements] : primitive.attributes) {
      const std::size_t accessor = add_meshopt(writer, name, elements, options);
      made["attributes"][name] = accessor;
      if (name == "POSITION") add_bounds(writer, accessor, elements);
    }
    // Indices of one byte are never compressed.
    const Elements indices = integers_of(primitive.indices, 1, primitive.index_type, false);
    if (primitive.index_type == 5121) {
      made["indices"] = writer.add_plain(indices);
    } else {
      const std::size_t accessor = writer.add_accessor(indices, indices.count());
      writer.json["accessors"][accessor]["bufferView"] =
          add_meshopt_view(writer, indices.bytes, indices.component_bytes(), options.index_mode, nullptr);
      made["indices"] = accessor;
    }
    return made;
  });
  return writer;
}

struct DracoOptions {
  bool sequential = false;
  bool lossless = false;
  bool seams = true;  ///< vertices at the same position are one, with several attributes
  int speed = 5;      ///< 0 to 10
};

inline draco::GeometryAttribute::Type draco_type(const std::string& name) {
  if (name == "POSITION") return draco::GeometryAttribute::POSITION;
  if (name == "NORMAL") return draco::GeometryAttribute::NORMAL;
  if (name.starts_with("TEXCOORD")) return draco::GeometryAttribute::TEX_COORD;
  if (name.starts_with("COLOR")) return draco::GeometryAttribute::COLOR;
  return draco::GeometryAttribute::GENERIC;
}

inline draco::DataType draco_component(int component_type) {
  constexpr std::array kTypes{draco::DT_INT8,    draco::DT_UINT8,  draco::DT_INT16,  draco::DT_UINT16,
                              draco::DT_INVALID, draco::DT_UINT32, draco::DT_FLOAT32};
  return kTypes.at(static_cast<std::size_t>(component_type - 5120));
}

/// The mesh, and in `ids` the unique id of each attribute.
inline std::unique_ptr<draco::Mesh> draco_mesh(const RandomPrimitive& primitive, const DracoOptions& options,
                                               std::map<std::string, std::uint32_t>& ids) {
  auto made = std::make_unique<draco::Mesh>();
  draco::Mesh& mesh = *made;
  const auto points = static_cast<std::uint32_t>(primitive.attributes.at("POSITION").count());
  mesh.set_num_points(points);
  mesh.SetNumFaces(primitive.indices.size() / 3);
  for (std::uint32_t i = 0; i < mesh.num_faces(); ++i) {
    draco::Mesh::Face face;
    for (std::size_t c = 0; c < 3; ++c) face[c] = draco::PointIndex(primitive.indices[std::size_t{i} * 3 + c]);
    mesh.SetFace(draco::FaceIndex(i), face);
  }
  for (const auto& [name, elements] : primitive.attributes) {
    draco::GeometryAttribute form;
    form.Init(draco_type(name), nullptr, static_cast<std::uint8_t>(elements.width),
              draco_component(elements.component_type), elements.normalized,
              static_cast<std::int64_t>(elements.element_bytes()), 0);
    draco::PointAttribute& attribute = *mesh.attribute(mesh.AddAttribute(form, true, points));
    for (std::uint32_t i = 0; i < points; ++i) {
      attribute.SetAttributeValue(draco::AttributeValueIndex(i), elements.bytes.data() + i * elements.element_bytes());
    }
    ids[name] = attribute.unique_id();
  }
  if (options.seams) {
    mesh.DeduplicateAttributeValues();
    mesh.DeduplicatePointIds();
  }
  return made;
}

inline ModelWriter write_draco(const RandomModel& model, const DracoOptions& options) {
  ModelWriter writer;
  writer.require("KHR_draco_mesh_compression");
  write_primitives(writer, model, [&](const RandomPrimitive& primitive) {
    std::map<std::string, std::uint32_t> ids;
    const std::unique_ptr<draco::Mesh> mesh = draco_mesh(primitive, options, ids);
    draco::Encoder encoder;
    encoder.SetEncodingMethod(options.sequential ? draco::MESH_SEQUENTIAL_ENCODING : draco::MESH_EDGEBREAKER_ENCODING);
    encoder.SetSpeedOptions(options.speed, options.speed);
    encoder.SetTrackEncodedProperties(true);
    if (!options.lossless) {
      encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, 14);
      encoder.SetAttributeQuantization(draco::GeometryAttribute::NORMAL, 10);
      encoder.SetAttributeQuantization(draco::GeometryAttribute::TEX_COORD, 12);
      encoder.SetAttributeQuantization(draco::GeometryAttribute::COLOR, 10);
      encoder.SetAttributeQuantization(draco::GeometryAttribute::GENERIC, 12);
    }
    draco::EncoderBuffer packed;
    EXPECT_TRUE(encoder.EncodeMeshToBuffer(*mesh, &packed).ok());
    Json extension{{"bufferView", writer.add_view(std::as_bytes(std::span(packed.data(), packed.size())))},
                   {"attributes", ids}};
    Json made{{"attributes", Json::object()}};
    for (const auto& [name, elements] : primitive.attributes) {
      const std::size_t accessor = writer.add_accessor(elements, encoder.num_encoded_points());
      made["attributes"][name] = accessor;
      if (name == "POSITION") add_bounds(writer, accessor, elements);
    }
    const Elements indices = integers_of({}, 1, primitive.index_type, false);
    made["indices"] = writer.add_accessor(indices, encoder.num_encoded_faces() * 3);
    made["extensions"]["KHR_draco_mesh_compression"] = std::move(extension);
    return made;
  });
  return writer;
}

/// How far two models may be apart; 0: not at all.
struct Tolerances {
  float position = 0.0F;
  float normal = 0.0F;
  float uv = 0.0F;
  float color = 0.0F;
};

/// A triangle's corners from the one with the smallest key on; the keys name the cells of random_primitive's grid.
using CornerKeys = std::array<std::int64_t, 3>;
inline std::pair<CornerKeys, glm::uvec3> canonical(const Mesh& mesh, const glm::uvec3& triangle) {
  const auto key = [&](std::uint32_t vertex) {
    const glm::vec3& p = mesh.positions[vertex];
    return std::int64_t{std::lround(p.y)} * 4096 + std::lround(p.x);
  };
  std::array<std::uint32_t, 3> corners{triangle.x, triangle.y, triangle.z};
  std::rotate(corners.begin(), std::ranges::min_element(corners, {}, key), corners.end());
  return {{key(corners[0]), key(corners[1]), key(corners[2])}, {corners[0], corners[1], corners[2]}};
}

template <typename Vector>
void expect_near(const std::vector<Vector>& a, std::uint32_t i, const std::vector<Vector>& b, std::uint32_t j,
                 float tolerance, const char* what) {
  ASSERT_EQ(a.empty(), b.empty()) << what;
  if (a.empty()) return;
  for (int axis = 0; axis < Vector::length(); ++axis) {
    ASSERT_LE(std::abs(a[i][axis] - b[j][axis]), tolerance) << what << " " << a[i][axis] << " and " << b[j][axis];
  }
}

inline void expect_same_vertex(const Mesh& plain, std::uint32_t i, const Mesh& packed, std::uint32_t j,
                               const Tolerances& tolerances) {
  expect_near(plain.positions, i, packed.positions, j, tolerances.position, "position");
  expect_near(plain.normals, i, packed.normals, j, tolerances.normal, "normal");
  expect_near(plain.tangents, i, packed.tangents, j, tolerances.normal, "tangent");
  expect_near(plain.uvs[0], i, packed.uvs[0], j, tolerances.uv, "first uv");
  expect_near(plain.uvs[1], i, packed.uvs[1], j, tolerances.uv, "second uv");
  expect_near(plain.colors, i, packed.colors, j, tolerances.color, "color");
}

/// Expects equal triangles of both meshes, whatever their order, and from whichever corner they begin.
inline void expect_same_triangles(const Mesh& plain, const Mesh& packed, const Tolerances& tolerances) {
  EXPECT_EQ(plain.triangles.size(), packed.triangles.size());
  EXPECT_EQ(plain.material, packed.material);
  std::map<CornerKeys, glm::uvec3> known;
  for (const glm::uvec3& triangle : plain.triangles) known.insert(canonical(plain, triangle));
  EXPECT_EQ(known.size(), plain.triangles.size()) << "the test's own keys are not unique";
  for (const glm::uvec3& triangle : packed.triangles) {
    const auto [keys, corners] = canonical(packed, triangle);
    const auto twin = known.find(keys);
    if (twin == known.end()) {
      ADD_FAILURE() << "no triangle of the plain model has these corners";
      return;
    }
    for (int c = 0; c < 3; ++c) expect_same_vertex(plain, twin->second[c], packed, corners[c], tolerances);
    if (::testing::Test::HasFatalFailure()) return;
    known.erase(twin);
  }
}

inline void expect_same_instances(const Scene& plain, const Scene& packed) {
  ASSERT_EQ(plain.instances.size(), packed.instances.size());
  EXPECT_EQ(plain.node_names, packed.node_names);
  for (std::size_t i = 0; i < plain.instances.size(); ++i) {
    const Instance& a = plain.instances[i];
    const Instance& b = packed.instances[i];
    EXPECT_TRUE(a.mesh == b.mesh && a.to_world == b.to_world) << "instance " << i;
  }
}

inline void expect_same_scene(const Scene& plain, const Scene& packed, const Tolerances& tolerances) {
  expect_same_instances(plain, packed);
  ASSERT_EQ(plain.meshes.size(), packed.meshes.size());
  for (std::size_t i = 0; i < plain.meshes.size(); ++i) {
    SCOPED_TRACE("mesh " + std::to_string(i));
    expect_same_triangles(plain.meshes[i], packed.meshes[i], tolerances);
  }
}

}  // namespace hpr::test
