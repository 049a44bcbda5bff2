#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <set>
#include <string>
#include <string_view>

#include "core/text.h"
#include "scene/gltf/item.h"
#include "scene/gltf/schema_check.h"

namespace hpr {
namespace {

constexpr std::array<std::string_view, 9> kSupported{
    "EXT_mesh_gpu_instancing", "KHR_lights_punctual",        "KHR_materials_emissive_strength",
    "KHR_materials_ior",       "KHR_materials_transmission", "KHR_materials_unlit",
    "KHR_materials_volume",    "KHR_mesh_quantization",      "KHR_texture_transform"};

/// Drawn approximately where it stands alone; check_shape warns of it.
constexpr std::string_view kStandsIn = "KHR_materials_pbrSpecularGlossiness";

/// Extensions that change how a surface looks and nothing else: such a scene is drawn without them, even when it
/// requires them.
constexpr std::array<std::string_view, 10> kLooks{
    "KHR_materials_anisotropy", "KHR_materials_clearcoat",   "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion", "KHR_materials_iridescence", kStandsIn,
    "KHR_materials_sheen",      "KHR_materials_specular",    "KHR_materials_variants",
    "KHR_xmp_json_ld"};

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
  root.each("materials", Presence::Optional, [&](const GltfItem& material) {
    const auto extensions = material.object("extensions");
    if (!extensions) return;
    std::set<std::string> names;
    for (const auto& [name, value] : extensions->value().members()) names.insert(name);
    for (const std::string& name : names) {
      if (declared.contains(name) || contains(kSupported, name) || name == kStandsIn) continue;
      root.warn("materials", fmt::format("{} is ignored", printable(name)));  // once, however many have it
    }
  });
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
    if (contains(kLooks, name)) {
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
