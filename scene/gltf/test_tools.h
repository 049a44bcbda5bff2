#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <vector>

#include "core/bytes.h"
#include "core/error.h"
#include "core/json.h"
#include "scene/gltf/gltf.h"

namespace hpr::test {

/// A folder that is removed with its content.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "hpr-gltf-XXXXXX").string();
    path_ = ::mkdtemp(name.data());
  }
  ~TemporaryFolder() { std::filesystem::remove_all(path_); }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  // NOLINTNEXTLINE(modernize-use-nodiscard): whoever writes several files wants the path of one
  std::filesystem::path write(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((path_ / name).parent_path());
    std::ofstream(path_ / name, std::ios::binary) << text;
    return path_ / name;
  }

 private:
  std::filesystem::path path_;
};

/// A glTF document that grows: every call adds a buffer, view and accessor of its own.
class Document {
 public:
  Json json = Json::parse(R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
      "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {}}]}]})");

  /// Adds an accessor of `count` elements over `values`; returns its index.
  template <typename Component>
  int add(const std::vector<Component>& values, const char* type, int component_type, std::size_t count) {
    const auto bytes = std::as_bytes(std::span(values));
    json["buffers"].push_back(
        {{"byteLength", bytes.size()}, {"uri", "data:application/octet-stream;base64," + base64(bytes)}});
    json["bufferViews"].push_back({{"buffer", json["buffers"].size() - 1}, {"byteLength", bytes.size()}});
    json["accessors"].push_back({{"bufferView", json["bufferViews"].size() - 1},
                                 {"componentType", component_type},
                                 {"count", count},
                                 {"type", type}});
    return static_cast<int>(json["accessors"].size() - 1);
  }
  int add_vec3(const std::vector<float>& values) { return add(values, "VEC3", 5126, values.size() / 3); }
  int add_vec2(const std::vector<float>& values) { return add(values, "VEC2", 5126, values.size() / 2); }
  int add_indices(const std::vector<std::uint16_t>& values) { return add(values, "SCALAR", 5123, values.size()); }

  Json& primitive() { return json["meshes"][0]["primitives"][0]; }
  Json& node() { return json["nodes"][0]; }
};

/// The triangle (0 0 0) (1 0 0) (0 1 0), without indices and normals.
inline Document triangle() {
  Document document;
  document.primitive()["attributes"]["POSITION"] = document.add_vec3({0, 0, 0, 1, 0, 0, 0, 1, 0});
  document.json["accessors"][0]["min"] = Json::array({0, 0, 0});
  document.json["accessors"][0]["max"] = Json::array({1, 1, 0});
  return document;
}

/// The square from (0 0 0) to (1 1 0) as four vertices around it.
inline Document square() {
  Document document;
  document.primitive()["attributes"]["POSITION"] = document.add_vec3({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0});
  document.json["accessors"][0]["min"] = Json::array({0, 0, 0});
  document.json["accessors"][0]["max"] = Json::array({1, 1, 0});
  return document;
}

inline Scene load(const Json& json, const SceneLimits& limits = {}, const SceneChoice& choice = {}) {
  const TemporaryFolder folder;
  return load_gltf(folder.write("scene.gltf", json.dump()), limits, choice).scene;
}
inline Scene load(const Json& json, const SceneChoice& choice) {
  return load(json, {}, choice);
}

/// What loading `json` complains of.
struct Refusal {
  ExitCode code = ExitCode::Done;
  std::string message;
  std::string hint;
};
inline Refusal refusal(const Json& json, const SceneLimits& limits = {}) {
  try {
    (void)load(json, limits);
  } catch (const Error& error) {
    return {error.code(), error.what(), error.hint()};
  }
  return {};
}

inline bool warns_of(const Scene& scene, const std::string& part) {
  for (const std::string& warning : scene.warnings) {
    if (warning.find(part) != std::string::npos) return true;
  }
  return false;
}

}  // namespace hpr::test
