#include "walls/manifest/manifest_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/file.h"
#include "core/text.h"

namespace hpr {
namespace {

using Json = nlohmann::ordered_json;

[[noreturn]] void refuse(const std::string& name, std::string_view why) {
  throw Error(ExitCode::BadInput, fmt::format("{} is no manifest of a wall's run: {}", printable(name, 200), why),
              "name the manifest.json that hpr wall run wrote");
}

Json parse(std::string_view text, const std::string& name) {
  constexpr int kDeepest = 16;
  bool too_deep = false;
  const auto look = [&](int depth, Json::parse_event_t, Json&) {
    too_deep = too_deep || depth > kDeepest;
    return !too_deep;
  };
  Json document = Json::parse(text.begin(), text.end(), look, false);
  if (document.is_discarded() || too_deep || !document.is_object()) refuse(name, "it is not such a JSON document");
  return document;
}

std::uint64_t hash_in(const Json& document, const std::string& key, const std::string& name) {
  const auto found = document.find(key);
  const std::string text = found != document.end() && found->is_string() ? found->get<std::string>() : "";
  std::uint64_t hash = 0;
  const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), hash, 16);
  if (failed != std::errc() || end != text.data() + text.size()) refuse(name, fmt::format("its {} is no hash", key));
  return hash;
}

std::vector<std::string> objects_in(const Json& document, const std::string& key, const std::string& name) {
  std::vector<std::string> objects;
  const auto found = document.find(key);
  if (found == document.end()) return objects;
  if (!found->is_array()) refuse(name, fmt::format("its {} are no list", key));
  for (const Json& object : *found) {
    if (!object.is_object()) refuse(name, fmt::format("one of its {} is no object", key));
    objects.push_back(object.dump(-1, ' ', false, Json::error_handler_t::replace));
  }
  return objects;
}

bool is_hash(const Json& value) {
  if (!value.is_string()) return false;
  const auto& text = value.get_ref<const std::string&>();
  return text.size() == 16 && text.find_first_not_of("0123456789abcdef") == std::string::npos;
}

bool tells_of(const Json& record, const WallScreen& screen) {
  return record.is_object() && record.value("id", Json()) == screen.id &&
         record.value("width", Json()) == screen.pixels.width &&
         record.value("height", Json()) == screen.pixels.height && is_hash(record.value("xxh64", Json()));
}

}  // namespace

void check_records(const ManifestFile& file, std::span<const WallScreen> screens, const std::string& name) {
  for (std::size_t i = 0; i < file.frames.size(); ++i) {
    const Json frame = Json::parse(file.frames[i]);
    const Json told = frame.value("screens", Json());
    const bool numbered = frame.value("frame", Json()) == i;
    if (numbered && told.is_array() && std::ranges::equal(told, screens, tells_of)) continue;
    throw Error(ExitCode::BadInput,
                fmt::format("{}: its record {} is not frame {} of this wall's screens at their sizes",
                            printable(name, 200), i, i),
                "go on with the same command line, or begin anew with --force in place of --resume");
  }
}

ManifestFile parse_manifest(std::string_view text, const std::string& name) {
  const Json document = parse(text, name);
  if (document.value("schema", Json()) != "hpr.wall-run/1") refuse(name, "its schema is not hpr.wall-run/1");
  ManifestFile file;
  file.scene_hash = hash_in(document, "scene_hash", name);
  file.wall_hash = hash_in(document, "wall_hash", name);
  const Json seed = document.value("seed", Json());
  if (!seed.is_number_unsigned()) refuse(name, "its seed is no number");
  file.seed = seed.get<std::uint64_t>();
  file.frames = objects_in(document, "frames", name);
  file.restarts = objects_in(document, "restarts", name);
  if (const auto stopped = document.find("stopped"); stopped != document.end()) {
    const bool sound = stopped->is_object() && stopped->value("of", Json()).is_number_integer();
    if (!sound) refuse(name, "where it was stopped is not told");
    file.stopped_of = (*stopped)["of"].get<int>();
  }
  return file;
}

ManifestFile load_manifest(const std::string& path) {
  constexpr std::uint64_t kLargest = std::uint64_t{1} << 30;
  const std::vector<std::byte> bytes = read_file(path, kLargest);
  return parse_manifest({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, path);
}

}  // namespace hpr
