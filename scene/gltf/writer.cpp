#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>
#include <optional>
#include <set>
#include <span>
#include <string>

#include "core/error.h"
#include "core/json.h"
#include "image/image_io.h"
#include "scene/gltf/gltf.h"

// Numbers are written so that they read back to the same bits: the JSON library prints the shortest decimal that does,
// and colours that glTF splits into a factor and a strength are split by a power of two.
namespace hpr {
namespace {

static_assert(std::endian::native == std::endian::little, "glTF buffers are little-endian");
static_assert(sizeof(glm::vec2) == 8 && sizeof(glm::vec3) == 12 && sizeof(glm::vec4) == 16 && sizeof(glm::uvec3) == 12);

constexpr int kFloat = 5126;
constexpr int kUnsignedInt = 5125;
constexpr int kPoints = 0;
constexpr int kLines = 1;
constexpr int kVertexBuffer = 34962;
constexpr int kIndexBuffer = 34963;

/// The file's two halves as they grow.
// NOLINTNEXTLINE(bugprone-exception-escape): moving a Json throws nothing
struct Document {
  Json json;
  std::vector<std::byte> buffer;
  std::set<std::string> extensions;

  /// Appends and returns the index of the new element.
  std::size_t add(const char* list, Json element) {
    Json& elements = json[list];
    elements.push_back(std::move(element));
    return elements.size() - 1;
  }

  /// A buffer view of `bytes`; `target` is 0 for pictures.
  std::size_t add_view(std::span<const std::byte> bytes, int target) {
    buffer.resize((buffer.size() + 3) / 4 * 4);
    Json view{{"buffer", 0}, {"byteOffset", buffer.size()}, {"byteLength", bytes.size()}};
    if (target != 0) view["target"] = target;
    buffer.insert(buffer.end(), bytes.begin(), bytes.end());
    return add("bufferViews", std::move(view));
  }

  template <typename Value>
  std::size_t add_accessor(const std::vector<Value>& values, const char* type) {
    const std::size_t view = add_view(std::as_bytes(std::span(values)), kVertexBuffer);
    return add("accessors",
               {{"bufferView", view}, {"componentType", kFloat}, {"count", values.size()}, {"type", type}});
  }
};

template <typename Vector>
Json numbers(const Vector& vector) {
  Json list = Json::array();
  for (glm::length_t i = 0; i < vector.length(); ++i) list.push_back(static_cast<double>(vector[i]));
  return list;
}

Json numbers(const glm::dmat4& matrix) {
  Json list = Json::array();
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) list.push_back(matrix[column][row]);
  }
  return list;
}

/// The least power of two that is no less than any component; 1 when all are zero. Dividing by it is exact.
float strength_of(const glm::vec3& color) {
  const float largest = std::max({color.r, color.g, color.b});
  if (!(largest > 0.0F) || !std::isfinite(largest)) return 1.0F;
  int exponent = 0;
  const float fraction = std::frexp(largest, &exponent);
  return std::ldexp(1.0F, fraction == 0.5F ? exponent - 1 : exponent);
}

int wrap_code(Wrap wrap) {
  switch (wrap) {
    case Wrap::MirroredRepeat:
      return 33648;
    case Wrap::ClampToEdge:
      return 33071;
    case Wrap::Repeat:
      break;
  }
  return 10497;
}

void write_textures(const Scene& scene, Document& document) {
  for (const Texture& texture : scene.textures) {
    const std::size_t view = document.add_view(encode_png(texture.image.image()), 0);
    const std::size_t image =
        document.add("images", {{"name", texture.name}, {"bufferView", view}, {"mimeType", "image/png"}});
    const std::size_t sampler = document.add("samplers", {{"magFilter", texture.nearest ? 9728 : 9729},
                                                          {"minFilter", texture.nearest ? 9728 : 9987},
                                                          {"wrapS", wrap_code(texture.wrap_s)},
                                                          {"wrapT", wrap_code(texture.wrap_t)}});
    document.add("textures", {{"name", texture.name}, {"source", image}, {"sampler", sampler}});
  }
}

/// KHR_texture_transform knows offset, rotation and scale: u' = sx cos r u + sy sin r v + ox, v' = -sx sin r u + sy cos
/// r v + oy. A shear cannot be written and loses its part along the rotated axis.
Json texture_info(const TextureRef& reference, Document& document) {
  Json info{{"index", reference.texture}};
  if (reference.uv_set != 0) info["texCoord"] = reference.uv_set;
  if (reference.transform != TextureRef{}.transform) {
    const auto& [a, b, c, d, e, f] = reference.transform;
    Json transform{{"offset", Json::array({e, f})}};
    if (b == 0.0F && c == 0.0F) {
      transform["scale"] = Json::array({a, d});
    } else {
      const double rotation = std::atan2(-static_cast<double>(b), static_cast<double>(a));
      transform["rotation"] = rotation;
      transform["scale"] = Json::array({std::hypot(static_cast<double>(a), static_cast<double>(b)),
                                        c * std::sin(rotation) + d * std::cos(rotation)});
    }
    info["extensions"]["KHR_texture_transform"] = std::move(transform);
    document.extensions.insert("KHR_texture_transform");
  }
  return info;
}

void write_detail(const Material& material, Json& element, Document& document) {
  if (material.normal_texture.present()) {
    Json& info = element["normalTexture"] = texture_info(material.normal_texture, document);
    if (material.normal_scale != Material{}.normal_scale) info["scale"] = material.normal_scale;
  }
  if (material.occlusion_texture.present()) {
    Json& info = element["occlusionTexture"] = texture_info(material.occlusion_texture, document);
    if (material.occlusion_strength != Material{}.occlusion_strength) info["strength"] = material.occlusion_strength;
  }
}

/// What light meets that goes through the surface.
void write_glass(const Material& material, Json& element, Document& document) {
  const auto extend = [&](const char* name, Json value) {
    element["extensions"][name] = std::move(value);
    document.extensions.insert(name);
  };
  const Material plain;
  if (material.transmission > 0.0F) {
    Json glass{{"transmissionFactor", material.transmission}};
    if (material.transmission_texture.present()) {
      glass["transmissionTexture"] = texture_info(material.transmission_texture, document);
    }
    extend("KHR_materials_transmission", std::move(glass));
  }
  if (material.ior != plain.ior) extend("KHR_materials_ior", {{"ior", material.ior}});
  Json volume = Json::object();
  if (material.thickness > 0.0F) volume["thicknessFactor"] = material.thickness;
  if (material.attenuation_color != plain.attenuation_color) {
    volume["attenuationColor"] = numbers(material.attenuation_color);
  }
  if (std::isfinite(material.attenuation_distance)) volume["attenuationDistance"] = material.attenuation_distance;
  if (!volume.empty()) extend("KHR_materials_volume", std::move(volume));
}

/// An extension's object, of which only what differs from the defaults is written.
class ExtensionWriter {
 public:
  explicit ExtensionWriter(Document& document) : document_(document) {}

  void number(const char* key, float value, float plain) {
    if (value != plain) object_[key] = value;
  }
  void color(const char* key, const glm::vec3& value, const glm::vec3& plain) {
    if (value != plain) object_[key] = numbers(value);
  }
  void texture(const char* key, const TextureRef& reference) {
    if (reference.present()) object_[key] = texture_info(reference, document_);
  }
  void scale(const char* key, float value) {
    if (object_.contains(key) && value != 1.0F) object_[key]["scale"] = value;
  }
  /// Adds it to the material, unless it is empty.
  void write(const char* name, Json& element) {
    if (object_.empty()) return;
    element["extensions"][name] = std::move(object_);
    document_.extensions.insert(name);
    object_ = Json::object();
  }

 private:
  Document& document_;
  Json object_ = Json::object();
};

void write_coats(const MaterialExtensions& from, ExtensionWriter& writer, Json& element) {
  const MaterialExtensions plain;
  writer.number("clearcoatFactor", from.clearcoat, plain.clearcoat);
  writer.texture("clearcoatTexture", from.clearcoat_texture);
  writer.number("clearcoatRoughnessFactor", from.clearcoat_roughness, plain.clearcoat_roughness);
  writer.texture("clearcoatRoughnessTexture", from.clearcoat_roughness_texture);
  writer.texture("clearcoatNormalTexture", from.clearcoat_normal_texture);
  writer.scale("clearcoatNormalTexture", from.clearcoat_normal_scale);
  writer.write("KHR_materials_clearcoat", element);
  writer.color("sheenColorFactor", from.sheen_color, plain.sheen_color);
  writer.texture("sheenColorTexture", from.sheen_color_texture);
  writer.number("sheenRoughnessFactor", from.sheen_roughness, plain.sheen_roughness);
  writer.texture("sheenRoughnessTexture", from.sheen_roughness_texture);
  writer.write("KHR_materials_sheen", element);
  writer.number("iridescenceFactor", from.iridescence, plain.iridescence);
  writer.texture("iridescenceTexture", from.iridescence_texture);
  writer.number("iridescenceIor", from.iridescence_ior, plain.iridescence_ior);
  writer.number("iridescenceThicknessMinimum", from.iridescence_min_nm, plain.iridescence_min_nm);
  writer.number("iridescenceThicknessMaximum", from.iridescence_max_nm, plain.iridescence_max_nm);
  writer.texture("iridescenceThicknessTexture", from.iridescence_thickness_texture);
  writer.write("KHR_materials_iridescence", element);
}

void write_specular_extensions(const MaterialExtensions& from, ExtensionWriter& writer, Json& element) {
  const MaterialExtensions plain;
  writer.number("specularFactor", from.specular, plain.specular);
  writer.texture("specularTexture", from.specular_texture);
  writer.color("specularColorFactor", from.specular_color, plain.specular_color);
  writer.texture("specularColorTexture", from.specular_color_texture);
  writer.write("KHR_materials_specular", element);
  writer.number("anisotropyStrength", from.anisotropy, plain.anisotropy);
  writer.number("anisotropyRotation", from.anisotropy_rotation_radians, plain.anisotropy_rotation_radians);
  writer.texture("anisotropyTexture", from.anisotropy_texture);
  writer.write("KHR_materials_anisotropy", element);
  writer.number("dispersion", from.dispersion, plain.dispersion);
  writer.write("KHR_materials_dispersion", element);
  writer.number("diffuseTransmissionFactor", from.diffuse_transmission, plain.diffuse_transmission);
  writer.texture("diffuseTransmissionTexture", from.diffuse_transmission_texture);
  writer.color("diffuseTransmissionColorFactor", from.diffuse_transmission_color, plain.diffuse_transmission_color);
  writer.texture("diffuseTransmissionColorTexture", from.diffuse_transmission_color_texture);
  writer.write("KHR_materials_diffuse_transmission", element);
}

void write_extensions(const Material& material, Json& element, Document& document) {
  if (!material.extensions) return;
  ExtensionWriter writer(document);
  write_coats(*material.extensions, writer, element);
  write_specular_extensions(*material.extensions, writer, element);
}

void write_materials(const Scene& scene, Document& document) {
  for (const Material& material : scene.materials) {
    Json surface{{"baseColorFactor", numbers(material.base_color)},
                 {"metallicFactor", material.metallic},
                 {"roughnessFactor", material.roughness}};
    if (material.base_color_texture.present()) {
      surface["baseColorTexture"] = texture_info(material.base_color_texture, document);
    }
    if (material.metallic_roughness_texture.present()) {
      surface["metallicRoughnessTexture"] = texture_info(material.metallic_roughness_texture, document);
    }
    Json element{{"name", material.name}, {"pbrMetallicRoughness", std::move(surface)}};
    const auto extend = [&](const char* name, Json value) {
      element["extensions"][name] = std::move(value);
      document.extensions.insert(name);
    };
    if (material.emissive != glm::vec3(0.0F)) {
      // Factors may not exceed 1.
      const float strength = std::max(1.0F, strength_of(material.emissive));
      element["emissiveFactor"] = numbers(material.emissive / strength);
      if (strength > 1.0F) extend("KHR_materials_emissive_strength", {{"emissiveStrength", strength}});
    }
    if (material.emissive_texture.present()) {
      element["emissiveTexture"] = texture_info(material.emissive_texture, document);
    }
    write_detail(material, element, document);
    write_glass(material, element, document);
    write_extensions(material, element, document);
    if (material.unlit) extend("KHR_materials_unlit", Json::object());
    if (material.alpha_mode == AlphaMode::Blend) element["alphaMode"] = "BLEND";
    if (material.alpha_mode == AlphaMode::Mask) {
      element["alphaMode"] = "MASK";
      element["alphaCutoff"] = material.alpha_cutoff;
    }
    if (material.double_sided) element["doubleSided"] = true;
    document.add("materials", std::move(element));
  }
}

constexpr std::size_t kNotWritten = std::numeric_limits<std::size_t>::max();

/// The corners of triangles or segments, or the points.
std::size_t write_indices(const Mesh& mesh, Document& document) {
  const int corners = mesh.kind == MeshKind::Points ? 1 : mesh.kind == MeshKind::Lines ? 2 : 3;
  std::vector<std::uint32_t> indices;
  indices.reserve(mesh.triangles.size() * static_cast<std::size_t>(corners));
  for (const glm::uvec3& triangle : mesh.triangles) {
    for (int corner = 0; corner < corners; ++corner) indices.push_back(triangle[corner]);
  }
  const std::size_t view = document.add_view(std::as_bytes(std::span(indices)), kIndexBuffer);
  return document.add(
      "accessors",
      {{"bufferView", view}, {"componentType", kUnsignedInt}, {"count", indices.size()}, {"type", "SCALAR"}});
}

/// The accessor of a mesh's positions, with their box.
std::size_t write_positions(const Mesh& mesh, Document& document) {
  glm::vec3 low = mesh.positions.front();
  glm::vec3 high = low;
  for (const glm::vec3& p : mesh.positions) {
    low = glm::min(low, p);
    high = glm::max(high, p);
  }
  const std::size_t positions = document.add_accessor(mesh.positions, "VEC3");
  document.json["accessors"][positions]["min"] = numbers(low);
  document.json["accessors"][positions]["max"] = numbers(high);
  return positions;
}

/// The accessor of a mesh's normals. Points and lines take light where they have any, whatever they are.
std::optional<std::size_t> write_normals(const Scene& scene, const Mesh& mesh, Document& document) {
  if (mesh.kind == MeshKind::Triangles) return document.add_accessor(mesh.normals, "VEC3");
  if (scene.materials[mesh.material].unlit) return std::nullopt;
  return document.add_accessor(std::vector(mesh.positions.size(), glm::vec3(0.0F, 0.0F, 1.0F)), "VEC3");
}

/// The index of each mesh in the file; meshes without triangles have no place in glTF.
std::vector<std::size_t> write_meshes(const Scene& scene, Document& document) {
  std::vector<std::size_t> written;
  for (const Mesh& mesh : scene.meshes) {
    if (mesh.triangles.empty()) {
      written.push_back(kNotWritten);
      continue;
    }
    Json attributes{{"POSITION", write_positions(mesh, document)}};
    if (const auto normals = write_normals(scene, mesh, document)) attributes["NORMAL"] = *normals;
    for (std::size_t set = 0; set < mesh.uvs.size(); ++set) {
      if (!mesh.uvs[set].empty()) {
        attributes[fmt::format("TEXCOORD_{}", set)] = document.add_accessor(mesh.uvs[set], "VEC2");
      }
    }
    if (!mesh.colors.empty()) attributes["COLOR_0"] = document.add_accessor(mesh.colors, "VEC4");
    if (!mesh.tangents.empty()) attributes["TANGENT"] = document.add_accessor(mesh.tangents, "VEC4");
    Json primitive{
        {"attributes", std::move(attributes)}, {"indices", write_indices(mesh, document)}, {"material", mesh.material}};
    if (mesh.kind != MeshKind::Triangles) primitive["mode"] = mesh.kind == MeshKind::Points ? kPoints : kLines;
    written.push_back(document.add("meshes", {{"name", mesh.name}, {"primitives", Json::array({primitive})}}));
  }
  return written;
}

void write_instances(const Scene& scene, const std::vector<std::size_t>& meshes, Document& document) {
  for (const Instance& instance : scene.instances) {
    if (meshes[instance.mesh] == kNotWritten) continue;
    Json node{{"mesh", meshes[instance.mesh]}};
    if (instance.to_world != glm::dmat4(1.0)) node["matrix"] = numbers(instance.to_world);
    document.add("nodes", std::move(node));
  }
}

/// A rigid motion that takes -z to `direction`.
glm::dmat4 pointing(const glm::dvec3& position, const glm::dvec3& direction) {
  const glm::dvec3 back = -glm::normalize(direction);
  const glm::dvec3 helper = std::abs(back.y) < 0.9 ? glm::dvec3(0, 1, 0) : glm::dvec3(1, 0, 0);
  const glm::dvec3 right = glm::normalize(glm::cross(helper, back));
  return {glm::dvec4(right, 0), glm::dvec4(glm::cross(back, right), 0), glm::dvec4(back, 0), glm::dvec4(position, 1)};
}

void write_lights(const Scene& scene, Document& document) {
  Json lights = Json::array();
  for (const Light& light : scene.lights) {
    if (light.type == LightType::Headlight) continue;
    const float strength = strength_of(light.intensity);
    Json element{{"name", light.name}, {"color", numbers(light.intensity / strength)}, {"intensity", strength}};
    if (light.range > 0.0) element["range"] = light.range;
    if (light.radius > 0.0) element["extras"]["radius"] = light.radius;
    if (light.angular_radius_radians > 0.0F) element["extras"]["angularRadius"] = light.angular_radius_radians;
    Json node{{"name", light.name}};
    if (light.type == LightType::Point) {
      element["type"] = "point";
      node["translation"] = numbers(light.position);
    } else {
      element["type"] = light.type == LightType::Spot ? "spot" : "directional";
      node["matrix"] = numbers(pointing(light.position, glm::dvec3(light.direction)));
    }
    if (light.type == LightType::Spot) {
      element["spot"] = {{"innerConeAngle", light.inner_cone_radians}, {"outerConeAngle", light.outer_cone_radians}};
    }
    node["extensions"]["KHR_lights_punctual"]["light"] = lights.size();
    lights.push_back(std::move(element));
    document.add("nodes", std::move(node));
  }
  if (lights.empty()) return;
  document.json["extensions"]["KHR_lights_punctual"]["lights"] = std::move(lights);
  document.extensions.insert("KHR_lights_punctual");
}

void write_cameras(const Scene& scene, Document& document) {
  // glTF demands a near plane; where ours is left to the renderer, so small a one that it cuts nothing off.
  const double extent = glm::length(scene.bounds.high - scene.bounds.low);
  const double near_by_default = extent > 0.0 && std::isfinite(extent) ? 1e-4 * extent : 0.01;
  for (const Camera& camera : scene.cameras) {
    Json element{{"name", camera.name}};
    if (const auto* const lens = std::get_if<PerspectiveLens>(&camera.lens)) {
      element["type"] = "perspective";
      element["perspective"] = {{"yfov", lens->vertical_fov_radians},
                                {"znear", lens->near_distance > 0.0 ? lens->near_distance : near_by_default}};
    } else {
      const auto& box = std::get<OrthographicLens>(camera.lens);
      element["type"] = "orthographic";
      element["orthographic"] = {{"xmag", box.half_width},
                                 {"ymag", box.half_height},
                                 {"znear", box.near_distance},
                                 {"zfar", box.far_distance}};
    }
    glm::dmat4 to_world(camera.axes);
    to_world[3] = glm::dvec4(camera.eye, 1.0);
    const std::size_t index = document.add("cameras", std::move(element));
    document.add("nodes", {{"name", camera.name}, {"camera", index}, {"matrix", numbers(to_world)}});
  }
}

void append_word(std::vector<std::byte>& bytes, std::uint32_t word) {
  const auto raw = std::as_bytes(std::span(&word, 1));
  bytes.insert(bytes.end(), raw.begin(), raw.end());
}

void append_chunk(std::vector<std::byte>& bytes, std::string_view type, std::span<const std::byte> content,
                  char padding) {
  const std::size_t padded = (content.size() + 3) / 4 * 4;
  append_word(bytes, static_cast<std::uint32_t>(padded));
  const auto name = std::as_bytes(std::span(type));
  bytes.insert(bytes.end(), name.begin(), name.end());
  bytes.insert(bytes.end(), content.begin(), content.end());
  bytes.insert(bytes.end(), padded - content.size(), static_cast<std::byte>(padding));
}

}  // namespace

std::vector<std::byte> encode_glb(const Scene& scene) {
  Document document;
  document.json["asset"] = {{"version", "2.0"}, {"generator", "hpr"}};
  document.json["scene"] = 0;
  document.json["scenes"] = Json::array();
  write_textures(scene, document);
  write_materials(scene, document);
  const std::vector<std::size_t> meshes = write_meshes(scene, document);
  write_instances(scene, meshes, document);
  write_lights(scene, document);
  write_cameras(scene, document);

  Json root{{"name", scene.name}};
  for (std::size_t i = 0; document.json.contains("nodes") && i < document.json["nodes"].size(); ++i) {
    root["nodes"].push_back(i);
  }
  document.json["scenes"].push_back(std::move(root));
  if (!document.extensions.empty()) document.json["extensionsUsed"] = document.extensions;
  if (!document.buffer.empty()) document.json["buffers"].push_back({{"byteLength", document.buffer.size()}});

  // Names are ours or came out of a file; bytes that are no UTF-8 are replaced rather than refused.
  const std::string text = document.json.dump();
  const std::uint64_t total = 12 + 8 + (text.size() + 3) / 4 * 4 + 8 + (document.buffer.size() + 3) / 4 * 4;
  if (total > std::numeric_limits<std::uint32_t>::max()) {
    throw Error(ExitCode::Limit, fmt::format("the scene needs {} bytes, a .glb file holds 4 GiB", total),
                "make a smaller scene, or draw it by its gen: name");
  }
  std::vector<std::byte> bytes;
  bytes.reserve(total);
  append_word(bytes, 0x46546C67U);  // "glTF"
  append_word(bytes, 2);
  append_word(bytes, 0);
  append_chunk(bytes, "JSON", std::as_bytes(std::span(text)), ' ');
  if (!document.buffer.empty()) append_chunk(bytes, std::string_view("BIN\0", 4), document.buffer, '\0');
  const auto length = static_cast<std::uint32_t>(bytes.size());
  std::memcpy(bytes.data() + 8, &length, sizeof(length));
  return bytes;
}

}  // namespace hpr
