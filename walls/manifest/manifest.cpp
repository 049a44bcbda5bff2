#include "walls/manifest/manifest.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <limits>
#include <optional>
#include <span>

#include "core/bytes.h"
#include "core/error.h"
#include "core/file.h"
#include "core/json.h"
#include "core/text.h"

namespace hpr {
namespace {

Json json_of(const HeadRecord& head) {
  const auto& [position, turn] = head.pose;
  return {{"viewer", head.viewer},
          {"position_m", Json::array({position.x, position.y, position.z})},
          {"orientation", Json::array({turn.x, turn.y, turn.z, turn.w})}};
}

Json picture_json(const ScreenRecord& screen) {
  return {
      {"id", screen.id}, {"width", screen.size.width}, {"height", screen.size.height}, {"xxh64", hex16(screen.xxh64)}};
}

Json json_of(const FrameRecord& frame) {
  Json record{{"frame", frame.frame}, {"ms", frame.ms}, {"strategy", frame.strategy}, {"screens", Json::array()}};
  for (const ScreenRecord& screen : frame.screens) {
    Json picture = picture_json(screen);
    picture["state"] = to_string(screen.state);
    record["screens"].push_back(std::move(picture));
  }
  record["exposure"] = frame.exposure_stops;
  record["tone"] = frame.tone;
  if (frame.budget) record["budget"] = budget_json(*frame.budget);
  // Apart from the screens: those are the same from run to run.
  for (const ScreenRecord& screen : frame.screens) {
    if (screen.rank < 0) continue;
    Json cost{{"id", screen.id}, {"rank", screen.rank}};
    if (screen.ms) cost["ms"] = *screen.ms;
    if (screen.bytes) cost["bytes"] = *screen.bytes;
    record["costs"].push_back(std::move(cost));
  }
  if (frame.slowest) {
    record["slowest"] = {{"rank", frame.slowest->rank},
                         {"host", frame.slowest->host},
                         {"ms", frame.slowest->ms},
                         {"pass", frame.slowest->pass},
                         {"pass_ms", frame.slowest->pass_ms}};
  }
  if (!frame.failed.empty()) record["failed"] = frame.failed;
  if (frame.verify) record["verify"] = verify_json(*frame.verify);
  for (const HeadRecord& head : frame.heads) record["heads"].push_back(json_of(head));
  for (const ScreenRecord& monitor : frame.monitors) record["monitors"].push_back(picture_json(monitor));
  if (frame.swap) record["swap"] = {{"skew_ms", frame.swap->skew_ms}};
  return record;
}

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

bool matches(const Json& record, const WallScreen& screen) {
  return record["id"] == screen.id && record["width"] == screen.pixels.width &&
         record["height"] == screen.pixels.height && is_hash(record["xxh64"]);
}

}  // namespace

std::string_view to_string(ScreenState state) {
  switch (state) {
    case ScreenState::Fresh:
      return "fresh";
    case ScreenState::Stale:
      return "stale";
    case ScreenState::Lost:
      break;
  }
  return "lost";
}

ScreenRecord record_screen(const std::string& id, const Image<Rgba8>& picture, ScreenState state) {
  return {id, picture.size(), xxh64(std::as_bytes(picture.pixels())), state};
}

Json budget_json(const BudgetRecord& budget) {
  return {{"target_ms", budget.target_ms},
          {"resolution_scale", budget.resolution_scale},
          {"samples", budget.samples},
          {"given_up", budget.given_up},
          {"resting", budget.resting}};
}

Json verify_json(const VerifyRecord& verify) {
  return {{"percent", verify.percent}, {"tiles", verify.tiles}, {"mismatches", verify.mismatches}};
}

std::string to_json(const FrameRecord& frame) {
  return json_of(frame).dump();
}

std::vector<std::uint64_t> failed_frames(std::span<const std::string> records) {
  std::vector<std::uint64_t> failed;
  for (const std::string& text : records) {
    const Json record = Json::parse(text);
    if (record.find("failed") == nullptr || !record["frame"].is_unsigned()) continue;
    failed.push_back(record["frame"].get<std::uint64_t>());
  }
  return failed;
}

std::string to_json(const RunManifest& manifest) {
  Json document{{"schema", "hpr.wall-run/1"},
                {"scene_hash", hex16(manifest.scene_hash)},
                {"wall_hash", hex16(manifest.wall_hash)},
                {"seed", manifest.seed},
                {"versions", manifest.versions},
                {"frames", Json::array()}};
  for (const std::string& frame : manifest.earlier) document["frames"].push_back(Json::parse(frame));
  for (const FrameRecord& frame : manifest.frames) document["frames"].push_back(json_of(frame));
  if (!manifest.restarts.empty()) {
    for (const std::string& restart : manifest.restarts) document["restarts"].push_back(Json::parse(restart));
  }
  if (manifest.stopped_of) {
    document["stopped"] = {{"frames", manifest.earlier.size() + manifest.frames.size()}, {"of", *manifest.stopped_of}};
  }
  if (manifest.degraded_seconds) document["degraded_seconds"] = *manifest.degraded_seconds;
  return document.dump(2) + "\n";
}

std::string to_json(const WallStatusRecord& status) {
  Json document{{"schema", "hpr.wall-status/1"}, {"run", status.run}, {"wall", status.wall}, {"scene", status.scene}};
  document["ranks"] = status.ranks;
  document["frame"] = status.frame;
  document["ms"] = status.ms;
  Json& screens = document["screens"] = Json::array();
  for (const auto& [id, state] : status.screens) screens.push_back({{"id", id}, {"state", to_string(state)}});
  Json& restarts = document["restarts"] = Json::array();
  for (const std::string& restart : status.restarts) restarts.push_back(Json::parse(restart));
  return document.dump(2);
}

void check_records(const ManifestFile& file, std::span<const WallScreen> screens, const std::string& name) {
  for (std::size_t i = 0; i < file.frames.size(); ++i) {
    const Json frame = Json::parse(file.frames[i]);
    const Json& listed = frame["screens"];
    const bool numbered = frame["frame"] == i;
    if (numbered && listed.is_array() && std::ranges::equal(listed.elements(), screens, matches)) continue;
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
  constexpr std::uint64_t kMaxFileBytes = std::uint64_t{1} << 30;
  const std::vector<std::byte> bytes = read_file(path, kMaxFileBytes);
  return parse_manifest({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, path);
}

}  // namespace hpr
