#include "scene/gltf/selection.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <string_view>
#include <utility>

#include "core/text.h"

namespace hpr {
namespace {

constexpr std::string_view kVariants = "KHR_materials_variants";

/// The names of the objects of a list, which may be anything.
std::vector<std::string> names_of(const Json* list, std::string_view kind) {
  std::vector<std::string> names;
  if (list == nullptr || !list->is_array()) return names;
  for (const Json& entry : list->elements()) {
    const Json& name = entry["name"];
    names.push_back(name.is_string() && !name.string().empty() ? name.string()
                                                               : fmt::format("{}{}", kind, names.size()));
  }
  return names;
}

[[noreturn]] void fail_unknown(const GltfContext& context, std::string_view kind, const std::string& wanted,
                               const std::vector<std::string>& names) {
  std::vector<std::string> choices;
  choices.reserve(names.size());
  for (const std::string& name : names) choices.push_back(printable(name));
  context.fail(
      "", fmt::format("the file has no {} '{}'", kind, printable(wanted)),
      choices.empty() ? fmt::format("it has none at all: leave --{} out", kind) : unknown_name_hint(wanted, choices),
      ExitCode::Usage);
}

bool names_variant(const Json& mapping, std::size_t variant) {
  const Json& variants = mapping["variants"];
  return variants.is_array() && std::ranges::any_of(variants.elements(), [&](const Json& index) {
           const auto number = whole_number(index);
           return number && *number >= 0 && static_cast<std::size_t>(*number) == variant;
         });
}

/// Calls visit(primitive, extensions) for each primitive that has extensions.
template <typename Visit>
void each_extended_primitive(Json& document, const Visit& visit) {
  Json* const meshes = document.find("meshes");
  if (meshes == nullptr || !meshes->is_array()) return;
  for (Json& mesh : meshes->elements()) {
    Json* const primitives = mesh.find("primitives");
    if (primitives == nullptr || !primitives->is_array()) continue;
    for (Json& primitive : primitives->elements()) {
      Json* const extensions = primitive.find("extensions");
      if (extensions != nullptr && extensions->is_object()) visit(primitive, *extensions);
    }
  }
}

}  // namespace

std::vector<std::string> scene_names(const Json& document) {
  return names_of(document.find("scenes"), "scene");
}

std::vector<std::string> variant_names(const Json& document) {
  return names_of(document["extensions"][kVariants].find("variants"), "variant");
}

std::size_t find_scene(const Json& document, const std::string& wanted, const GltfContext& context) {
  if (wanted.empty()) {
    const auto named = whole_number(document["scene"]);
    return named && *named >= 0 ? static_cast<std::size_t>(*named) : 0;
  }
  const std::vector<std::string> names = scene_names(document);
  const auto found = std::ranges::find(names, wanted);
  if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
  std::size_t index = 0;
  const char* const last = wanted.data() + wanted.size();
  const auto [stop, error] = std::from_chars(wanted.data(), last, index);
  if (error != std::errc() || stop != last || index >= names.size()) fail_unknown(context, "scene", wanted, names);
  return index;
}

void apply_variant(Json& document, const std::string& wanted, const GltfContext& context) {
  if (wanted.empty()) {
    each_extended_primitive(document, [](Json&, Json& extensions) { extensions.erase(kVariants); });
    return;
  }
  const std::vector<std::string> names = variant_names(document);
  const auto found = std::ranges::find(names, wanted);
  if (found == names.end()) fail_unknown(context, "variant", wanted, names);
  const auto variant = static_cast<std::size_t>(found - names.begin());
  each_extended_primitive(document, [&](Json& primitive, Json& extensions) {
    const Json& mappings = std::as_const(extensions)[kVariants]["mappings"];
    if (!mappings.is_array()) return;  // check_shape says so
    const auto mapping = std::ranges::find_if(mappings.elements(),
                                              [&](const Json& candidate) { return names_variant(candidate, variant); });
    if (mapping != mappings.elements().end()) primitive["material"] = (*mapping)["material"];
  });
}

}  // namespace hpr
