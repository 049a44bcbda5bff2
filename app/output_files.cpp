#include "app/output_files.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <system_error>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/file.h"
#include "core/text.h"
#include "scene/load_scene.h"

namespace hpr {

void write_or_print(std::string_view text, const std::string& path, bool overwrite) {
  if (path.empty()) {
    fmt::print("{}", text);
    return;
  }
  check_writable(path, overwrite);
  write_file_atomically(path, text);
}

void check_distinct(std::span<const std::string> paths, const std::string& trace) {
  std::set<std::filesystem::path> named;
  std::vector<std::string> all(paths.begin(), paths.end());
  all.push_back(trace);
  for (const std::string& path : all) {
    std::error_code error;
    const std::filesystem::path plain = std::filesystem::absolute(path, error);
    const std::filesystem::path place = std::filesystem::weakly_canonical(plain, error);
    if (path.empty() || named.insert(error ? plain : place).second) continue;
    throw Error(ExitCode::Usage, fmt::format("'{}' is named for two results", printable(path)),
                "give each its own name");
  }
}

void check_spared(const std::string& scene, const SceneLimits& limits, std::span<const std::string> inputs,
                  std::span<const std::string> results) {
  const auto identity = [](const std::filesystem::path& path) -> std::optional<std::pair<dev_t, ino_t>> {
    struct stat info {};
    if (path.empty() || ::stat(path.c_str(), &info) != 0) return std::nullopt;
    return std::pair(info.st_dev, info.st_ino);
  };
  std::map<std::pair<dev_t, ino_t>, std::string> replaced;
  for (const std::string& result : results) {
    if (const auto file = identity(result)) replaced.emplace(*file, result);
  }
  if (replaced.empty()) return;  // spares reading the scene twice
  std::vector<std::filesystem::path> files = files_of_scene(scene, limits);
  files.insert(files.end(), inputs.begin(), inputs.end());
  for (const std::filesystem::path& path : files) {
    const auto file = identity(path);
    const auto result = file ? replaced.find(*file) : replaced.end();
    if (result == replaced.end()) continue;
    throw Error(ExitCode::Usage, fmt::format("'{}' is read, and would be replaced", printable(result->second)),
                "give the result another name");
  }
}

}  // namespace hpr
