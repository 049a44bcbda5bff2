#include "scene/gltf/materials.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

#include "core/bytes.h"
#include "core/text.h"
#include "image/image_io.h"
#include "scene/gltf/uri.h"

namespace hpr {
namespace {

const tinygltf::Value* extension(const tinygltf::ExtensionMap& extensions, const char* name) {
  const auto found = extensions.find(name);
  return found == extensions.end() ? nullptr : &found->second;
}

double number_in(const tinygltf::Value& object, const char* key, double fallback) {
  return object.Has(key) ? object.Get(key).GetNumberAsDouble() : fallback;
}

float float_in(const tinygltf::Value& object, const char* key, float fallback) {
  return static_cast<float>(number_in(object, key, static_cast<double>(fallback)));
}

glm::vec3 color_in(const tinygltf::Value& object, const char* key, const glm::vec3& fallback) {
  if (!object.Has(key)) return fallback;
  glm::vec3 color;
  for (int c = 0; c < 3; ++c) color[c] = static_cast<float>(object.Get(key).Get(c).GetNumberAsDouble());
  return color;
}

/// Whether a surface with these extensions differs from one without anywhere.
bool has_effect(const MaterialExtensions& extensions) {
  const bool reflects_less = extensions.specular != 1.0F || extensions.specular_texture.present() ||
                             extensions.specular_color != glm::vec3(1.0F) ||
                             extensions.specular_color_texture.present();
  return reflects_less || extensions.clearcoat > 0.0F || extensions.sheen_color != glm::vec3(0.0F) ||
         extensions.anisotropy > 0.0F || extensions.iridescence > 0.0F || extensions.dispersion > 0.0F ||
         extensions.diffuse_transmission > 0.0F;
}

std::array<double, 2> pair_in(const tinygltf::Value& object, const char* key, double fallback) {
  if (!object.Has(key)) return {fallback, fallback};
  const tinygltf::Value& pair = object.Get(key);
  return {pair.Get(0).GetNumberAsDouble(), pair.Get(1).GetNumberAsDouble()};
}

Wrap wrap_of(int mode, const std::string& where, GltfContext& context) {
  switch (mode) {
    case TINYGLTF_TEXTURE_WRAP_REPEAT:
      return Wrap::Repeat;
    case TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE:
      return Wrap::ClampToEdge;
    case TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT:
      return Wrap::MirroredRepeat;
    default:
      context.warn(where, fmt::format("the wrap mode {} is unknown; taken as repeat", mode));
      return Wrap::Repeat;
  }
}

bool is_nearest(int filter, const std::string& where, GltfContext& context) {
  if (filter == TINYGLTF_TEXTURE_FILTER_NEAREST) return true;
  if (filter != -1 && filter != TINYGLTF_TEXTURE_FILTER_LINEAR) {
    context.warn(where, fmt::format("the filter {} is unknown; taken as linear", filter));
  }
  return false;
}

/// KHR_texture_transform: scale, then turn, then move (uv' = T R S uv, with v pointing down).
std::array<float, 6> uv_transform(const tinygltf::Value& transform) {
  const auto offset = pair_in(transform, "offset", 0.0);
  const auto scale = pair_in(transform, "scale", 1.0);
  const double rotation = number_in(transform, "rotation", 0.0);
  const double c = std::cos(rotation);
  const double s = std::sin(rotation);
  const std::array<double, 6> exact{c * scale[0], -s * scale[0], s * scale[1], c * scale[1], offset[0], offset[1]};
  std::array<float, 6> rounded{};
  std::ranges::transform(exact, rounded.begin(), [](double value) { return static_cast<float>(value); });
  return rounded;
}

glm::vec3 color_of(const std::vector<double>& values, double fallback) {
  return values.size() >= 3 ? glm::vec3(glm::dvec3(values[0], values[1], values[2]))
                            : glm::vec3(static_cast<float>(fallback));
}

}  // namespace

void GltfMaterials::find_emissive() {
  const tinygltf::Model& model = data_.model();
  emissive_.resize(images_.is_array() ? images_.size() : 0);
  for (const tinygltf::Material& material : model.materials) {
    const int texture = material.emissiveTexture.index;
    if (texture < 0 || GltfData::to_size(texture) >= model.textures.size()) continue;
    const int image = model.textures[GltfData::to_size(texture)].source;
    if (image >= 0 && GltfData::to_size(image) < emissive_.size()) emissive_[GltfData::to_size(image)] = true;
  }
}

void GltfMaterials::build(Scene& scene) {
  find_emissive();
  const auto& materials = data_.model().materials;
  data_.context().charge(materials.size() * sizeof(Material), "the materials");
  for (std::size_t i = 0; i < materials.size(); ++i) {
    scene.materials.emplace_back().name = materials[i].name;
    data_.context().check_entry(
        "materials", i, [&] { scene.materials[i] = material(materials[i], fmt::format("materials[{}]", i), scene); });
  }
}

Material GltfMaterials::material(const tinygltf::Material& from, const std::string& where, Scene& scene) {
  const tinygltf::PbrMetallicRoughness& pbr = from.pbrMetallicRoughness;
  Material to;
  to.name = from.name;
  if (const auto& c = pbr.baseColorFactor; c.size() == 4) to.base_color = glm::vec4(glm::dvec4(c[0], c[1], c[2], c[3]));
  to.base_color_texture = texture_ref(pbr.baseColorTexture, where + ".pbrMetallicRoughness.baseColorTexture", scene);
  to.metallic = static_cast<float>(pbr.metallicFactor);
  to.roughness = static_cast<float>(pbr.roughnessFactor);
  to.metallic_roughness_texture =
      texture_ref(pbr.metallicRoughnessTexture, where + ".pbrMetallicRoughness.metallicRoughnessTexture", scene);
  to.emissive = color_of(from.emissiveFactor, 0.0);
  to.emissive_texture = texture_ref(from.emissiveTexture, where + ".emissiveTexture", scene);
  to.alpha_mode = from.alphaMode == "MASK"    ? AlphaMode::Mask
                  : from.alphaMode == "BLEND" ? AlphaMode::Blend
                                              : AlphaMode::Opaque;
  to.alpha_cutoff = static_cast<float>(from.alphaCutoff);
  to.double_sided = from.doubleSided;
  add_detail(from, where, scene, to);
  add_extensions(from, where, scene, to);
  return to;
}

void GltfMaterials::add_detail(const tinygltf::Material& from, const std::string& where, Scene& scene, Material& to) {
  to.normal_texture = texture_ref(from.normalTexture, where + ".normalTexture", scene);
  to.normal_scale = static_cast<float>(from.normalTexture.scale);
  to.occlusion_texture = texture_ref(from.occlusionTexture, where + ".occlusionTexture", scene);
  to.occlusion_strength = static_cast<float>(from.occlusionTexture.strength);
}

void GltfMaterials::add_extensions(const tinygltf::Material& from, const std::string& where, Scene& scene,
                                   Material& to) {
  if (const auto* strength = extension(from.extensions, "KHR_materials_emissive_strength")) {
    to.emissive *= static_cast<float>(number_in(*strength, "emissiveStrength", 1.0));
  }
  if (const auto* transmission = extension(from.extensions, "KHR_materials_transmission")) {
    to.transmission = static_cast<float>(number_in(*transmission, "transmissionFactor", 0.0));
    to.transmission_texture = texture_in(*transmission, "transmissionTexture", where, scene);
  }
  if (const auto* ior = extension(from.extensions, "KHR_materials_ior")) {
    to.ior = static_cast<float>(number_in(*ior, "ior", 1.5));
  }
  if (const auto* volume = extension(from.extensions, "KHR_materials_volume")) {
    // The texture of the thickness is for renderers that cannot look where light leaves again.
    to.thickness = static_cast<float>(number_in(*volume, "thicknessFactor", 0.0));
    to.attenuation_distance = static_cast<float>(
        number_in(*volume, "attenuationDistance", static_cast<double>(Material{}.attenuation_distance)));
    to.attenuation_color = color_in(*volume, "attenuationColor", glm::vec3(1.0F));
  }
  to.unlit = extension(from.extensions, "KHR_materials_unlit") != nullptr;
  if (to.unlit) return;
  MaterialExtensions extensions;
  add_coats(from, where, scene, extensions);
  add_specular_extensions(from, where, scene, extensions);
  if (has_effect(extensions)) to.extensions = std::make_shared<const MaterialExtensions>(extensions);
}

/// What lies on the material.
void GltfMaterials::add_coats(const tinygltf::Material& from, const std::string& where, Scene& scene,
                              MaterialExtensions& to) {
  if (const auto* coat = extension(from.extensions, "KHR_materials_clearcoat")) {
    to.clearcoat = float_in(*coat, "clearcoatFactor", to.clearcoat);
    to.clearcoat_texture = texture_in(*coat, "clearcoatTexture", where, scene);
    to.clearcoat_roughness = float_in(*coat, "clearcoatRoughnessFactor", to.clearcoat_roughness);
    to.clearcoat_roughness_texture = texture_in(*coat, "clearcoatRoughnessTexture", where, scene);
    to.clearcoat_normal_texture = texture_in(*coat, "clearcoatNormalTexture", where, scene);
    if (coat->Has("clearcoatNormalTexture")) {
      to.clearcoat_normal_scale = float_in(coat->Get("clearcoatNormalTexture"), "scale", to.clearcoat_normal_scale);
    }
  }
  if (const auto* sheen = extension(from.extensions, "KHR_materials_sheen")) {
    to.sheen_color = color_in(*sheen, "sheenColorFactor", to.sheen_color);
    to.sheen_color_texture = texture_in(*sheen, "sheenColorTexture", where, scene);
    to.sheen_roughness = float_in(*sheen, "sheenRoughnessFactor", to.sheen_roughness);
    to.sheen_roughness_texture = texture_in(*sheen, "sheenRoughnessTexture", where, scene);
  }
  if (const auto* film = extension(from.extensions, "KHR_materials_iridescence")) {
    to.iridescence = float_in(*film, "iridescenceFactor", to.iridescence);
    to.iridescence_texture = texture_in(*film, "iridescenceTexture", where, scene);
    to.iridescence_ior = float_in(*film, "iridescenceIor", to.iridescence_ior);
    to.iridescence_min_nm = float_in(*film, "iridescenceThicknessMinimum", to.iridescence_min_nm);
    to.iridescence_max_nm = float_in(*film, "iridescenceThicknessMaximum", to.iridescence_max_nm);
    to.iridescence_thickness_texture = texture_in(*film, "iridescenceThicknessTexture", where, scene);
  }
}

/// How the material itself scatters.
void GltfMaterials::add_specular_extensions(const tinygltf::Material& from, const std::string& where, Scene& scene,
                                            MaterialExtensions& to) {
  if (const auto* specular = extension(from.extensions, "KHR_materials_specular")) {
    to.specular = float_in(*specular, "specularFactor", to.specular);
    to.specular_texture = texture_in(*specular, "specularTexture", where, scene);
    to.specular_color = color_in(*specular, "specularColorFactor", to.specular_color);
    to.specular_color_texture = texture_in(*specular, "specularColorTexture", where, scene);
  }
  if (const auto* anisotropy = extension(from.extensions, "KHR_materials_anisotropy")) {
    to.anisotropy = float_in(*anisotropy, "anisotropyStrength", to.anisotropy);
    to.anisotropy_rotation_radians = float_in(*anisotropy, "anisotropyRotation", to.anisotropy_rotation_radians);
    to.anisotropy_texture = texture_in(*anisotropy, "anisotropyTexture", where, scene);
  }
  if (const auto* dispersion = extension(from.extensions, "KHR_materials_dispersion")) {
    to.dispersion = float_in(*dispersion, "dispersion", to.dispersion);
  }
  if (const auto* diffuse = extension(from.extensions, "KHR_materials_diffuse_transmission")) {
    to.diffuse_transmission = float_in(*diffuse, "diffuseTransmissionFactor", to.diffuse_transmission);
    to.diffuse_transmission_texture = texture_in(*diffuse, "diffuseTransmissionTexture", where, scene);
    to.diffuse_transmission_color = color_in(*diffuse, "diffuseTransmissionColorFactor", to.diffuse_transmission_color);
    to.diffuse_transmission_color_texture = texture_in(*diffuse, "diffuseTransmissionColorTexture", where, scene);
  }
}

/// The texture that an extension's object names by `key`.
TextureRef GltfMaterials::texture_in(const tinygltf::Value& object, const char* key, const std::string& where,
                                     Scene& scene) {
  if (!object.Has(key)) return {};
  const tinygltf::Value& info = object.Get(key);
  tinygltf::ExtensionMap extensions;
  if (info.Has("extensions")) extensions = info.Get("extensions").Get<tinygltf::Value::Object>();
  return texture_ref(info.Get("index").GetNumberAsInt(), static_cast<int>(number_in(info, "texCoord", 0.0)), extensions,
                     fmt::format("{}.{}", where, key), scene);
}

TextureRef GltfMaterials::texture_ref(int index, int uv_set, const tinygltf::ExtensionMap& extensions,
                                      const std::string& where, Scene& scene) {
  TextureRef ref;
  if (index < 0) return ref;
  ref.uv_set = static_cast<std::uint32_t>(uv_set);
  if (const auto* transform = extension(extensions, "KHR_texture_transform")) {
    ref.transform = uv_transform(*transform);
    if (transform->Has("texCoord"))
      ref.uv_set = static_cast<std::uint32_t>(transform->Get("texCoord").GetNumberAsInt());
  }
  if (ref.uv_set > 1) {
    data_.context().warn(where,
                         fmt::format("uses TEXCOORD_{}; only 0 and 1 are read, the texture is left out", ref.uv_set));
    return {};
  }
  ref.texture = texture(index, where, scene);
  return ref.present() ? ref : TextureRef{};
}

std::int32_t GltfMaterials::texture(int index, const std::string& where, Scene& scene) {
  const tinygltf::Texture& from = data_.model().textures[GltfData::to_size(index)];
  GltfContext& context = data_.context();
  if (from.source < 0) {
    context.warn(where, fmt::format("textures[{}] has no picture that HPR reads; left out", index));
    return -1;
  }
  SamplerKey key{from.source, Wrap::Repeat, Wrap::Repeat, false};
  if (from.sampler >= 0) {
    const tinygltf::Sampler& sampler = data_.model().samplers[GltfData::to_size(from.sampler)];
    const std::string where_sampler = fmt::format("samplers[{}]", from.sampler);
    key = {from.source, wrap_of(sampler.wrapS, where_sampler, context), wrap_of(sampler.wrapT, where_sampler, context),
           is_nearest(sampler.magFilter, where_sampler, context)};
  }
  if (const auto known = textures_.find(key); known != textures_.end()) return known->second;

  Texture made;
  std::tie(std::ignore, made.wrap_s, made.wrap_t, made.nearest) = key;
  const auto held = pictures_.find(from.source);
  if (held != pictures_.end() && held->second < 0) return -1;
  if (held != pictures_.end()) {
    const Texture& twin = scene.textures[static_cast<std::size_t>(held->second)];
    made.image = twin.image;
    made.name = twin.name;
    sources_.push_back(sources_[static_cast<std::size_t>(held->second)]);
  } else {
    auto read = picture(from.source);
    if (!read) {
      pictures_[from.source] = -1;
      return -1;
    }
    made.image = std::move(read->texels);
    sources_.push_back(std::move(read->source));
    const Json& entry = images_[GltfData::to_size(from.source)];
    made.name = entry.contains("name") && entry["name"].is_string() ? entry["name"].get<std::string>()
                                                                    : fmt::format("image {}", from.source);
  }
  const auto position = static_cast<std::int32_t>(scene.textures.size());
  scene.textures.push_back(std::move(made));
  textures_[key] = position;
  pictures_.try_emplace(from.source, position);
  return position;
}

GltfMaterials::Picture GltfMaterials::decoded(int image, std::span<const std::byte> bytes,
                                              const std::optional<FileLocation>& location) {
  GltfContext& context = data_.context();
  const std::string name = fmt::format("{}: images[{}]", context.name(), image);
  // Decoding holds the file's channels beside the result.
  ImageLimits limits = context.limits().image;
  limits.pixels = std::min(limits.pixels, context.memory_left() / 8);
  Picture picture{decode_image(bytes, name, limits), nullptr};
  if (!location || emissive_[GltfData::to_size(image)]) {
    context.charge(picture.texels.size_bytes(), "a texture");
    return picture;
  }
  picture.texels = Texels(picture.texels.size(), picture.texels.facts());
  picture.source = std::make_shared<const PictureSource>(
      PictureSource{name, std::filesystem::absolute(location->file).string(), location->file_bytes, location->offset,
                    bytes.size(), xxh64(bytes)});
  return picture;
}

std::optional<GltfMaterials::Picture> GltfMaterials::picture(int image) {
  GltfContext& context = data_.context();
  const Json& entry = images_[GltfData::to_size(image)];
  const std::string where = fmt::format("images[{}]", image);
  const bool has_uri = entry.contains("uri");
  const bool has_view = entry.contains("bufferView");
  if (!has_uri && !has_view) {
    context.warn(where, "has neither a uri nor a bufferView; left out");
    return std::nullopt;
  }
  if (has_uri && has_view) context.warn(where, "has a uri and a bufferView; the bufferView is read");
  if (has_view && !entry.contains("mimeType")) context.warn(where, "has no mimeType");
  try {
    if (has_view) {
      const std::span<const std::byte> bytes = data_.view(entry["bufferView"].get<int>());
      Picture read = decoded(image, bytes, buffers_.location_of(bytes));
      if (context.reads_in_parts()) data_.forget();
      return read;
    }
    const auto uri = entry["uri"].get<std::string>();
    const FileBytes file = buffers_.resolve(uri, where, context);
    std::optional<FileLocation> location;
    if (context.reads_in_parts() && !is_data_uri(uri)) {
      location = {std::filesystem::path(context.name()).parent_path() / jailed_path(uri, where), file.bytes().size(),
                  0};
    }
    return decoded(image, file.bytes(), location);
  } catch (const Error& error) {
    // A scene without one of its pictures is still worth drawing; past the limits the user has to decide.
    if (error.code() != ExitCode::BadInput && error.code() != ExitCode::Io) throw;
    context.warn("", fmt::format("{}; drawn without it", error.what()));
    return std::nullopt;
  }
}

}  // namespace hpr
