#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <string>
#include <string_view>

#include "core/text.h"
#include "scene/gltf/document.h"
#include "scene/gltf/selection.h"

namespace hpr {
namespace {

constexpr auto kRequired = Presence::Required;
constexpr auto kOptional = Presence::Optional;
/// Radiance, intensity and the like are held to what sums and squares of single precision can carry.
constexpr double kMaxIntensity = 1e12;
constexpr double kMaxRadius = 1e12;  // of a light, metres

void check_asset(const GltfItem& root) {
  const auto asset = root.object("asset", kRequired);
  const auto read_version = [&](const char* key, Presence presence) -> std::string {
    if (asset->has(key) && asset->value()[key].is_number()) {
      asset->warn(key, "should be text");
      asset->value()[key] = fmt::format("{:.1f}", asset->value()[key].get<double>());
    }
    const auto text = asset->text(key, presence);
    if (!text) return "2.0";
    const bool known =
        text->size() >= 3 && text->starts_with("2.") && text->find_first_not_of("0123456789", 2) == std::string::npos;
    if (!known) asset->fail(key, fmt::format("is \"{}\"; HPR reads glTF 2", printable(*text)));
    return *text;
  };
  read_version("version", kRequired);
  // Later minor versions stay readable by what reads 2.0, unless they say otherwise (glTF 2.0, section 3.2).
  const std::string min_version = read_version("minVersion", kOptional);
  if (min_version.find_first_not_of('0', 2) != std::string::npos) {
    asset->fail("minVersion", fmt::format("is \"{}\"; HPR reads glTF 2.0", printable(min_version)),
                "export the scene as glTF 2.0");
  }
}

void check_buffers(const GltfItem& root) {
  root.each_entry("buffers", kOptional, [](const GltfItem& buffer) {
    buffer.text("uri");
    buffer.whole("byteLength", kRequired, 1);
    const auto extensions = buffer.object("extensions");
    if (const auto meshopt = extensions ? extensions->object("EXT_meshopt_compression") : std::nullopt) {
      meshopt->flag("fallback");
    }
  });
  root.each_entry("bufferViews", kOptional, [](const GltfItem& view) {
    view.index("buffer", "buffers", kRequired);
    view.whole("byteOffset");
    view.whole("byteLength", kRequired, 1);
    const auto stride = view.whole("byteStride", kOptional, 1, 252);
    if (stride && *stride % 4 != 0) view.fail("byteStride", fmt::format("is {}, not a multiple of 4", *stride));
    view.whole("target");
    const auto extensions = view.object("extensions");
    const auto meshopt = extensions ? extensions->object("EXT_meshopt_compression") : std::nullopt;
    if (!meshopt) return;
    meshopt->index("buffer", "buffers", kRequired);
    meshopt->whole("byteOffset");
    meshopt->whole("byteLength", kRequired, 1);
    meshopt->whole("byteStride", kRequired, 1, 256);
    meshopt->whole("count", kRequired, 1);
    meshopt->text("mode", kRequired);
    meshopt->text("filter");
  });
}

void check_component_type(const GltfItem& item, const char* key) {
  const auto type = item.whole(key, kRequired);
  if (*type < 5120 || *type > 5126 || *type == 5124) {
    item.fail(key, fmt::format("is {}, which is no component type of glTF", *type));
  }
}

void check_accessors(const GltfItem& root) {
  root.each_entry("accessors", kOptional, [](const GltfItem& accessor) {
    accessor.index("bufferView", "bufferViews");
    accessor.whole("byteOffset");
    check_component_type(accessor, "componentType");
    accessor.flag("normalized");
    accessor.whole("count", kRequired, 1);
    const auto type = accessor.text("type", kRequired);
    constexpr std::array<std::string_view, 7> kTypes{"SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"};
    if (std::ranges::find(kTypes, *type) == kTypes.end()) {
      accessor.fail("type", fmt::format("is \"{}\", which is no type of glTF", printable(*type)));
    }
    accessor.numbers("min", 0, -std::numeric_limits<double>::max(), std::numeric_limits<double>::max());
    accessor.numbers("max", 0, -std::numeric_limits<double>::max(), std::numeric_limits<double>::max());
    if (const auto sparse = accessor.object("sparse")) {
      // The model holds these as int.
      constexpr std::uint64_t kMaxCount = std::numeric_limits<std::int32_t>::max();
      const auto count = sparse->whole("count", kRequired, 0, kMaxCount);
      if (*count == 0) sparse->warn("count", "is 0");
      const auto indices = sparse->object("indices", kRequired);
      indices->index("bufferView", "bufferViews", kRequired);
      indices->whole("byteOffset", kOptional, 0, kMaxCount);
      check_component_type(*indices, "componentType");
      const auto values = sparse->object("values", kRequired);
      values->index("bufferView", "bufferViews", kRequired);
      values->whole("byteOffset", kOptional, 0, kMaxCount);
    }
  });
}

void check_draco(const GltfItem& primitive) {
  const auto extensions = primitive.object("extensions");
  const auto draco = extensions ? extensions->object("KHR_draco_mesh_compression") : std::nullopt;
  if (!draco) return;
  draco->index("bufferView", "bufferViews", kRequired);
  const auto attributes = draco->object("attributes", kRequired);
  constexpr std::uint64_t kMaxId = std::numeric_limits<std::uint32_t>::max();
  for (const auto& [name, value] : attributes->value().members()) {
    attributes->whole(name.c_str(), kRequired, 0, kMaxId);
  }
}

/// KHR_materials_variants; apply_variant has removed what no variant asks for.
void check_mappings(const GltfItem& primitive, std::size_t variants) {
  const auto extensions = primitive.object("extensions");
  const auto own = extensions ? extensions->object("KHR_materials_variants") : std::nullopt;
  if (!own) return;
  own->each("mappings", kRequired, [&](const GltfItem& mapping) {
    mapping.indices_below("variants", variants, kRequired);
    mapping.index("material", "materials", kRequired);
  });
}

void check_meshes(const GltfItem& root) {
  const std::size_t variants = variant_names(root.value()).size();
  root.each_entry("meshes", kOptional, [&](const GltfItem& mesh) {
    mesh.numbers("weights", 0);
    const std::size_t count = mesh.each("primitives", kRequired, [&](const GltfItem& primitive) {
      if (primitive.index_map("attributes", "accessors", kRequired) == 0) {
        primitive.fail("attributes", "is empty");
      }
      check_draco(primitive);
      check_mappings(primitive, variants);
      primitive.index("indices", "accessors");
      primitive.index("material", "materials");
      primitive.whole("mode", kOptional, 0, 6);
      if (primitive.has("targets")) {
        const Json& targets = primitive.value()["targets"];
        if (!targets.is_array()) primitive.fail("targets", "must be an array");
        primitive.each("targets", kOptional, [](const GltfItem& target) {
          for (const auto& [name, value] : target.value().members()) {
            target.index(name.c_str(), "accessors", kRequired);
          }
        });
      }
    });
    if (count == 0) mesh.warn("primitives", "is empty");
  });
}

void check_nodes(const GltfItem& root) {
  constexpr double kAny = std::numeric_limits<double>::max();
  const auto extensions = root.object("extensions");
  const auto punctual = extensions ? extensions->object("KHR_lights_punctual") : std::nullopt;
  const std::size_t lights = punctual && punctual->has("lights") ? punctual->value()["lights"].size() : 0;

  root.each_entry("nodes", kOptional, [&](const GltfItem& node) {
    node.text("name");
    node.index("mesh", "meshes");
    node.index("camera", "cameras");
    node.index("skin", "skins");
    node.indices("children", "nodes");
    node.numbers("weights", 0);
    const bool matrix = node.numbers("matrix", 16, -kAny, kAny);
    const bool rotation = node.numbers("rotation", 4, -kAny, kAny);
    const bool scale = node.numbers("scale", 3, -kAny, kAny);
    const bool translation = node.numbers("translation", 3, -kAny, kAny);
    if (matrix && (rotation || scale || translation)) {
      node.warn("matrix", "stands beside translation, rotation or scale, which are ignored");
    }
    const auto own = node.object("extensions");
    if (!own) return;
    if (const auto light = own->object("KHR_lights_punctual")) {
      if (punctual) {
        light->index_below("light", lights, kRequired);
      } else {
        light->warn("", "the document has no lights");
        own->value().erase("KHR_lights_punctual");
      }
    }
    if (const auto visibility = own->object("KHR_node_visibility")) visibility->flag("visible");
    if (const auto instancing = own->object("EXT_mesh_gpu_instancing")) {
      instancing->index_map("attributes", "accessors", kRequired);
    }
  });
}

void check_scenes(const GltfItem& root) {
  root.index("scene", "scenes");
  root.each_entry("scenes", kOptional, [](const GltfItem& scene) {
    scene.text("name");
    scene.indices("nodes", "nodes");
  });
  root.each_entry("skins", kOptional, [](const GltfItem& skin) {
    if (skin.indices("joints", "nodes", kRequired) == 0) skin.fail("joints", "is empty");
    skin.index("inverseBindMatrices", "accessors");
    skin.index("skeleton", "nodes");
  });
  root.each_entry("animations", kOptional, [](const GltfItem& animation) {
    const std::size_t samplers = animation.each("samplers", kRequired, [](const GltfItem& sampler) {
      sampler.index("input", "accessors", kRequired);
      sampler.index("output", "accessors", kRequired);
    });
    animation.each("channels", kRequired, [&](const GltfItem& channel) {
      channel.index_below("sampler", samplers, kRequired);
      if (const auto target = channel.object("target", kRequired)) {
        target->index("node", "nodes");
        target->text("path", kRequired);
      }
    });
  });
}

std::optional<GltfItem> check_texture_info(const GltfItem& material, const char* key) {
  auto info = material.object(key);
  if (!info) return info;
  info->index("index", "textures", kRequired);
  info->whole("texCoord", kOptional, 0, 1000);
  const auto extensions = info->object("extensions");
  const auto transform = extensions ? extensions->object("KHR_texture_transform") : std::nullopt;
  if (!transform) return info;
  transform->numbers("offset", 2, -1e6, 1e6);
  transform->numbers("scale", 2, -1e6, 1e6);
  transform->number("rotation");
  transform->whole("texCoord", kOptional, 0, 1000);
  return info;
}

/// Makes a WebP picture the texture's own: the PNG or JPEG beside it is for renderers that do not read WebP.
/// KHR_texture_basisu cannot be read; what stands beside it can.
void choose_picture(const GltfItem& texture) {
  const auto extensions = texture.object("extensions");
  if (!extensions) return;
  const bool basisu = extensions->object("KHR_texture_basisu").has_value();
  if (const auto webp = extensions->object("EXT_texture_webp")) {
    if (const auto source = webp->index("source", "images")) texture.value()["source"] = *source;
  }
  if (!basisu) return;
  if (!texture.has("source")) {
    texture.fail("", "has but a KTX 2 picture (KHR_texture_basisu), which HPR cannot read", kKtxHint);
  }
  texture.warn("", "has a KTX 2 picture (KHR_texture_basisu), which HPR cannot read; drawn with the one beside it");
}

void check_textures(const GltfItem& root) {
  root.each_entry("images", kOptional, [](const GltfItem& image) {
    image.text("uri");
    image.text("mimeType");
    image.index("bufferView", "bufferViews");
  });
  root.each_entry("samplers", kOptional, [](const GltfItem& sampler) {
    for (const char* key : {"magFilter", "minFilter", "wrapS", "wrapT"}) sampler.whole(key, kOptional, 0, 65535);
  });
  root.each_entry("textures", kOptional, [](const GltfItem& texture) {
    texture.index("sampler", "samplers");
    texture.index("source", "images");
    choose_picture(texture);
  });
}

/// Factors that are shares, and textures.
void check_shares(const GltfItem& object, std::initializer_list<const char*> factors,
                  std::initializer_list<const char*> textures) {
  for (const char* key : factors) object.clamped(key, 0.0, 1.0);
  for (const char* key : textures) check_texture_info(object, key);
}

void check_coats(const GltfItem& extensions) {
  if (const auto coat = extensions.object("KHR_materials_clearcoat")) {
    check_shares(*coat, {"clearcoatFactor", "clearcoatRoughnessFactor"},
                 {"clearcoatTexture", "clearcoatRoughnessTexture"});
    if (const auto normal = check_texture_info(*coat, "clearcoatNormalTexture")) normal->clamped("scale", -1e6, 1e6);
  }
  if (const auto sheen = extensions.object("KHR_materials_sheen")) {
    sheen->numbers("sheenColorFactor", 3, 0.0, 1.0);
    check_shares(*sheen, {"sheenRoughnessFactor"}, {"sheenColorTexture", "sheenRoughnessTexture"});
  }
  if (const auto film = extensions.object("KHR_materials_iridescence")) {
    check_shares(*film, {"iridescenceFactor"}, {"iridescenceTexture", "iridescenceThicknessTexture"});
    film->clamped("iridescenceIor", 1.0, 1000.0);
    film->clamped("iridescenceThicknessMinimum", 0.0, 1e6);
    film->clamped("iridescenceThicknessMaximum", 0.0, 1e6);
  }
}

void check_specular_extensions(const GltfItem& extensions) {
  if (const auto specular = extensions.object("KHR_materials_specular")) {
    specular->numbers("specularColorFactor", 3, 0.0, GltfItem::kMaxNumber);
    check_shares(*specular, {"specularFactor"}, {"specularTexture", "specularColorTexture"});
  }
  if (const auto anisotropy = extensions.object("KHR_materials_anisotropy")) {
    check_shares(*anisotropy, {"anisotropyStrength"}, {"anisotropyTexture"});
    anisotropy->number("anisotropyRotation");
  }
  if (const auto dispersion = extensions.object("KHR_materials_dispersion")) {
    dispersion->clamped("dispersion", 0.0, 1000.0);
  }
  if (const auto diffuse = extensions.object("KHR_materials_diffuse_transmission")) {
    diffuse->numbers("diffuseTransmissionColorFactor", 3, 0.0, 1.0);
    check_shares(*diffuse, {"diffuseTransmissionFactor"},
                 {"diffuseTransmissionTexture", "diffuseTransmissionColorTexture"});
  }
}

void check_material_extensions(const GltfItem& extensions) {
  if (const auto emissive = extensions.object("KHR_materials_emissive_strength")) {
    emissive->clamped("emissiveStrength", 0.0, kMaxIntensity);
  }
  if (const auto transmission = extensions.object("KHR_materials_transmission")) {
    transmission->clamped("transmissionFactor", 0.0, 1.0);
    check_texture_info(*transmission, "transmissionTexture");
  }
  if (const auto refraction = extensions.object("KHR_materials_ior")) {
    // 0 is allowed and means a mirror at every angle.
    if (const auto ior = refraction->number("ior"); ior && *ior != 0.0) refraction->clamped("ior", 1.0, 1000.0);
  }
  if (const auto volume = extensions.object("KHR_materials_volume")) {
    volume->clamped("thicknessFactor", 0.0, GltfItem::kMaxNumber);
    check_texture_info(*volume, "thicknessTexture");
    // The extension wants more than 0; what lets light less far is black to every picture.
    volume->clamped("attenuationDistance", 1e-12, GltfItem::kMaxNumber);
    volume->numbers("attenuationColor", 3, 0.0, 1.0);
  }
  (void)extensions.object("KHR_materials_unlit");
  check_coats(extensions);
  check_specular_extensions(extensions);
}

/// A material of specular colour and glossiness alone is taken as a dielectric of its diffuse colour and glossiness.
void stand_in_for_glossiness(const GltfItem& material) {
  const auto extensions = material.object("extensions");
  const auto glossy = extensions ? extensions->object("KHR_materials_pbrSpecularGlossiness") : std::nullopt;
  if (!glossy || material.has("pbrMetallicRoughness")) return;
  double glossiness = glossy->clamped("glossinessFactor", 0.0, 1.0).value_or(1.0);
  if (glossy->has("specularGlossinessTexture")) glossiness *= 0.5;  // its alpha is seldom all white
  Json stand_in{{"metallicFactor", 0.0}, {"roughnessFactor", 1.0 - glossiness}};
  if (glossy->has("diffuseFactor")) stand_in["baseColorFactor"] = glossy->value()["diffuseFactor"];
  if (glossy->has("diffuseTexture")) stand_in["baseColorTexture"] = glossy->value()["diffuseTexture"];
  material.warn("extensions.KHR_materials_pbrSpecularGlossiness",
                "taken as a dielectric of its diffuse colour and glossinessFactor, halved where a texture says more");
  material.value()["pbrMetallicRoughness"] = std::move(stand_in);
}

void check_materials(const GltfItem& root) {
  root.each_entry("materials", kOptional, [](const GltfItem& material) {
    material.text("name");
    stand_in_for_glossiness(material);
    if (const auto pbr = material.object("pbrMetallicRoughness")) {
      pbr->numbers("baseColorFactor", 4, 0.0, 1.0);
      pbr->clamped("metallicFactor", 0.0, 1.0);
      pbr->clamped("roughnessFactor", 0.0, 1.0);
      check_texture_info(*pbr, "baseColorTexture");
      check_texture_info(*pbr, "metallicRoughnessTexture");
    }
    check_texture_info(material, "emissiveTexture");
    if (const auto normal = check_texture_info(material, "normalTexture")) normal->clamped("scale", -1e6, 1e6);
    if (const auto occlusion = check_texture_info(material, "occlusionTexture")) {
      occlusion->clamped("strength", 0.0, 1.0);
    }
    material.numbers("emissiveFactor", 3, 0.0, 1.0);
    material.clamped("alphaCutoff", 0.0, GltfItem::kMaxNumber);
    material.flag("doubleSided");
    const auto mode = material.text("alphaMode");
    if (mode && *mode != "OPAQUE" && *mode != "MASK" && *mode != "BLEND") {
      material.warn("alphaMode", fmt::format("\"{}\" is unknown; taken as OPAQUE", printable(*mode)));
      material.value()["alphaMode"] = "OPAQUE";
    }
    if (const auto extensions = material.object("extensions")) check_material_extensions(*extensions);
  });
}

void check_perspective(const GltfItem& lens) {
  constexpr double kMinNumber = std::numeric_limits<float>::min();
  // At half a turn the picture plane is infinitely wide; 3.141 is 179.97 degrees.
  const double fov = *lens.number("yfov", kRequired, kMinNumber, 3.141);
  if (fov < 1e-3) lens.warn("yfov", fmt::format("{} radians are less than a telescope sees", fov));
  const double near_distance = *lens.number("znear", kRequired, kMinNumber);
  if (near_distance < 1e-6) lens.warn("znear", fmt::format("{} metres leave depths little precision", near_distance));
  const auto far_distance = lens.number("zfar", kOptional, kMinNumber);
  if (far_distance && *far_distance <= near_distance) lens.fail("zfar", "must be larger than znear");
  lens.number("aspectRatio", kOptional, kMinNumber);
}

void check_orthographic(const GltfItem& lens) {
  for (const char* key : {"xmag", "ymag"}) {
    if (*lens.number(key, kRequired) == 0.0) lens.fail(key, "must not be zero");
  }
  const double near_distance = *lens.number("znear", kRequired, 0.0);
  if (*lens.number("zfar", kRequired) <= near_distance) lens.fail("zfar", "must be larger than znear");
}

void check_cameras(const GltfItem& root) {
  root.each_entry("cameras", kOptional, [](const GltfItem& camera) {
    camera.text("name");
    const auto type = camera.text("type", kRequired);
    if (*type == "perspective") {
      check_perspective(*camera.object("perspective", kRequired));
    } else if (*type == "orthographic") {
      check_orthographic(*camera.object("orthographic", kRequired));
    } else {
      camera.fail("type", fmt::format("is \"{}\", neither perspective nor orthographic", printable(*type)));
    }
  });
}

/// A number in a light's `extras` that gives it an extent. Extras may hold anything, so what is no such number is left
/// out with a warning instead of refused.
void check_extent(const GltfItem& light, const char* key, double high) {
  if (!light.has("extras")) return;
  Json& extras = light.value()["extras"];
  if (!extras.is_object() || !extras.contains(key)) return;
  Json& value = extras[key];
  const double number = value.is_number() ? value.get<double>() : -1.0;
  if (number >= 0.0 && number <= high) {
    value = number;  // tinygltf keeps integers in 32 bits
    return;
  }
  light.warn("extras", fmt::format("has a {} that is no number from 0 to {:.4g}; left out", key, high));
  extras.erase(key);
}

void check_lights(const GltfItem& root) {
  const auto extensions = root.object("extensions");
  const auto punctual = extensions ? extensions->object("KHR_lights_punctual") : std::nullopt;
  if (!punctual) return;
  punctual->each_entry("lights", kRequired, [](const GltfItem& light) {
    light.text("name");
    const auto type = light.text("type", kRequired);
    if (*type != "point" && *type != "directional" && *type != "spot") {
      light.fail("type", fmt::format("is \"{}\"; point, directional and spot are known", printable(*type)));
    }
    light.numbers("color", 3, 0.0, kMaxIntensity);
    light.clamped("intensity", 0.0, kMaxIntensity);
    const auto range = light.number("range");
    if (range && *range <= 0.0) {
      light.warn("range", fmt::format("is {}; taken as unbounded", *range));
      light.value().erase("range");
    }
    check_extent(light, "radius", kMaxRadius);
    check_extent(light, "angularRadius", std::numbers::pi / 2);
    const auto spot = light.object("spot", *type == "spot" ? kRequired : kOptional);
    if (!spot) return;
    const double outer = spot->clamped("outerConeAngle", 1e-4, std::numbers::pi / 2).value_or(std::numbers::pi / 4);
    const double inner = spot->clamped("innerConeAngle", 0.0, std::numbers::pi / 2).value_or(0.0);
    if (inner >= outer) {
      spot->warn("innerConeAngle", fmt::format("is {}, not less than outerConeAngle, {}", inner, outer));
      spot->value()["innerConeAngle"] = outer;
    }
  });
}

}  // namespace

void check_shape(Json& document, GltfContext& context) {
  const GltfItem root(context, document);
  check_asset(root);
  check_buffers(root);
  check_accessors(root);
  check_meshes(root);
  check_lights(root);
  check_nodes(root);
  check_scenes(root);
  check_textures(root);
  check_materials(root);
  check_cameras(root);
}

namespace {

constexpr std::array<std::string_view, 21> kSupported{
    "EXT_mesh_gpu_instancing",    "EXT_meshopt_compression",
    "EXT_texture_webp",           "KHR_draco_mesh_compression",
    "KHR_lights_punctual",        "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",   "KHR_materials_emissive_strength",
    "KHR_materials_ior",          "KHR_materials_iridescence",
    "KHR_materials_sheen",        "KHR_materials_specular",
    "KHR_materials_transmission", "KHR_materials_unlit",
    "KHR_materials_variants",     "KHR_materials_volume",
    "KHR_mesh_quantization",      "KHR_node_visibility",
    "KHR_texture_transform"};

/// Drawn approximately where it stands alone; check_shape warns of it.
constexpr std::string_view kStandsIn = "KHR_materials_pbrSpecularGlossiness";

/// Extensions that change how a surface looks and nothing else: such a scene is drawn without them, even when it
/// requires them.
constexpr std::array<std::string_view, 3> kAppearanceOnly{kStandsIn, "KHR_texture_basisu", "KHR_xmp_json_ld"};

bool contains(const auto& names, std::string_view name) {
  return std::ranges::find(names, name) != names.end();
}

/// The names in the array `key`, each once.
std::set<std::string> names_in(const GltfItem& root, const char* key) {
  std::set<std::string> names;
  if (!root.has(key)) return names;
  const Json& list = root.value()[key];
  if (!list.is_array()) root.fail(key, "must be an array of names");
  for (const Json& entry : list.elements()) {
    if (!entry.is_string()) root.fail(key, "must be an array of names");
    const auto name = entry.get<std::string>();
    if (!names.insert(name).second) root.warn(key, fmt::format("names {} twice", printable(name)));
  }
  return names;
}

/// Warns of material extensions that are neither drawn nor declared, which check_extensions has not named yet.
void warn_of_undeclared(const GltfItem& root, const std::set<std::string>& declared) {
  const Json* const materials = section_of(root.value(), "materials");
  if (materials == nullptr) return;
  for (const Json& material : materials->elements()) {
    const Json& extensions = material["extensions"];
    if (!extensions.is_object()) continue;  // check_shape says so
    std::set<std::string> names;
    for (const auto& [name, value] : extensions.members()) names.insert(name);
    for (const std::string& name : names) {
      if (declared.contains(name) || contains(kSupported, name) || name == kStandsIn) continue;
      root.warn("materials", fmt::format("{} is ignored", printable(name)));  // once, however many have it
    }
  }
}

}  // namespace

void check_extensions(Json& document, GltfContext& context) {
  const GltfItem root(context, document);
  const std::set<std::string> used = names_in(root, "extensionsUsed");
  const std::set<std::string> required = names_in(root, "extensionsRequired");
  for (const std::string& name : required) {
    if (!used.contains(name)) {
      root.warn("extensionsRequired", fmt::format("{} is not among extensionsUsed", printable(name)));
    }
    if (contains(kSupported, name)) continue;
    if (contains(kAppearanceOnly, name)) {
      root.warn("extensionsRequired", fmt::format("{} is not supported; surfaces may look different", name));
      continue;
    }
    if (name.find("compression") != std::string::npos) {
      root.fail("extensionsRequired",
                fmt::format("the meshes are compressed with {}, which HPR cannot read", printable(name)),
                kDecompressHint);
    }
    root.fail("extensionsRequired", fmt::format("the scene requires {}, which HPR does not know", printable(name)),
              "export it without this extension");
  }
  for (const std::string& name : used) {
    if (required.contains(name) || contains(kSupported, name)) continue;
    root.warn("extensionsUsed", fmt::format("{} is ignored", printable(name)));
  }
  std::set<std::string> declared = used;
  declared.insert(required.begin(), required.end());
  warn_of_undeclared(root, declared);
}

}  // namespace hpr
