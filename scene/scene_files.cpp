#include "scene/scene_files.h"

#include <nlohmann/json.hpp>

#include "core/error.h"
#include "scene/gltf/scan.h"
#include "scene/gltf/uri.h"

namespace hpr {
namespace {

/// The file a buffer or picture says it lies in, if any.
void add_named(const nlohmann::json& item, const std::filesystem::path& folder,
               std::vector<std::filesystem::path>& files) {
  const auto uri = item.is_object() ? item.find("uri") : item.end();
  if (uri == item.end() || !uri->is_string() || is_data_uri(uri->get_ref<const std::string&>())) return;
  try {
    files.push_back(folder / jailed_path(uri->get_ref<const std::string&>(), ""));
  } catch (const Error&) {  // load_scene tells
  }
}

}  // namespace

std::vector<std::filesystem::path> files_of_scene(const std::string& source, const SceneLimits& limits) {
  if (source.starts_with("gen:")) return {};
  const std::filesystem::path path = source;
  std::vector<std::filesystem::path> files{path};
  try {
    GltfContext context(source, limits);
    const GltfFile file = open_gltf(path, context);
    const nlohmann::json root = nlohmann::json::parse(file.parts.json, nullptr, false);
    if (!root.is_object()) return files;
    for (const char* const list : {"buffers", "images"}) {
      if (!root.contains(list) || !root[list].is_array()) continue;
      for (const nlohmann::json& item : root[list]) add_named(item, path.parent_path(), files);
    }
  } catch (const Error&) {  // load_scene tells
  }
  return files;
}

}  // namespace hpr
