#include "walls/manifest/manifest_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <limits>
#include <optional>

#include "core/error.h"
#include "core/file.h"
#include "core/json.h"
#include "core/text.h"

namespace hpr {
namespace {

[[noreturn]] void refuse(const std::string& name, std::string_view why) {
  throw Error(ExitCode::BadInput, fmt::format("{} is no manifest of a wall's run: {}", printable(name, 200), why),
              "name the manifest.json that hpr wall run wrote");
}

Json parse(std::string_view text, const std::string& name) {
  constexpr int kMaxDepth = 16;
  std::optional<Json> document = Json::try_parse(text, kMaxDepth);
  if (!document || !document->is_object()) refuse(name, "it is not such a JSON document");
  return *std::move(document);
}

std::uint64_t hash_in(const Json& document, const std::string& key, const std::string& name) {
  const std::string text = document[key].is_string() ? document[key].string() : "";
  std::uint64_t hash = 0;
  const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), hash, 16);
  if (failed != std::errc() || end != text.data() + text.size()) refuse(name, fmt::format("its {} is no hash", key));
  return hash;
}

std::vector<std::string> objects_in(const Json& document, const std::string& key, const std::string& name) {
  std::vector<std::string> objects;
  const Json* const found = document.find(key);
  if (found == nullptr) return objects;
  if (!found->is_array()) refuse(name, fmt::format("its {} are no list", key));
  for (const Json& object : found->elements()) {
    if (!object.is_object()) refuse(name, fmt::format("one of its {} is no object", key));
    objects.push_back(object.dump());
  }
  return objects;
}

bool is_hash(const Json& value) {
  if (!value.is_string()) return false;
  const std::string& text = value.string();
  return text.size() == 16 && text.find_first_not_of("0123456789abcdef") == std::string::npos;
}

bool tells_of(const Json& record, const WallScreen& screen) {
  return record["id"] == screen.id && record["width"] == screen.pixels.width &&
         record["height"] == screen.pixels.height && is_hash(record["xxh64"]);
}

}  // namespace

void check_records(const ManifestFile& file, std::span<const WallScreen> screens, const std::string& name) {
  for (std::size_t i = 0; i < file.frames.size(); ++i) {
    const Json frame = Json::parse(file.frames[i]);
    const Json& told = frame["screens"];
    const bool numbered = frame["frame"] == i;
    if (numbered && told.is_array() && std::ranges::equal(told.elements(), screens, tells_of)) continue;
    throw Error(ExitCode::BadInput,
                fmt::format("{}: its record {} is not frame {} of this wall's screens at their sizes",
                            printable(name, 200), i, i),
                "go on with the same command line, or begin anew with --force in place of --resume");
  }
}

ManifestFile parse_manifest(std::string_view text, const std::string& name) {
  const Json document = parse(text, name);
  if (document["schema"] != "hpr.wall-run/1") refuse(name, "its schema is not hpr.wall-run/1");
  ManifestFile file;
  file.scene_hash = hash_in(document, "scene_hash", name);
  file.wall_hash = hash_in(document, "wall_hash", name);
  const Json& seed = document["seed"];
  if (!seed.is_unsigned()) refuse(name, "its seed is no number");
  file.seed = seed.get<std::uint64_t>();
  file.frames = objects_in(document, "frames", name);
  file.restarts = objects_in(document, "restarts", name);
  if (const Json* const stopped = document.find("stopped")) {
    const Json& of = (*stopped)["of"];
    if (!of.is_unsigned() || of.get<double>() > std::numeric_limits<int>::max()) {
      refuse(name, "where it was stopped is not told");
    }
    file.stopped_of = of.get<int>();
  }
  return file;
}

ManifestFile load_manifest(const std::string& path) {
  constexpr std::uint64_t kLargest = std::uint64_t{1} << 30;
  const std::vector<std::byte> bytes = read_file(path, kLargest);
  return parse_manifest({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, path);
}

}  // namespace hpr
