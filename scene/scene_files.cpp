#include "scene/scene_files.h"

#include "core/error.h"
#include "core/json.h"
#include "scene/gltf/scan.h"
#include "scene/gltf/uri.h"

namespace hpr {
namespace {

/// The file a buffer or picture says it lies in, if any.
void add_named(const Json& item, const std::filesystem::path& folder, std::vector<std::filesystem::path>& files) {
  const Json& uri = item["uri"];
  if (!uri.is_string() || is_data_uri(uri.string())) return;
  try {
    files.push_back(folder / jailed_path(uri.string(), ""));
  } catch (const Error&) {  // load_scene reports it
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
    const Json root = Json::try_parse(file.parts.json).value_or(Json());
    for (const char* const list : {"buffers", "images"}) {
      if (!root[list].is_array()) continue;
      for (const Json& item : root[list].elements()) add_named(item, path.parent_path(), files);
    }
  } catch (const Error&) {  // load_scene reports it
  }
  return files;
}

}  // namespace hpr
