#include "walls/manifest/manifest.h"

#include <span>

#include "core/bytes.h"

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
  for (const HeadRecord& head : frame.heads) record["heads"].push_back(json_of(head));
  for (const ScreenRecord& monitor : frame.monitors) record["monitors"].push_back(picture_json(monitor));
  if (frame.swap) record["swap"] = {{"skew_ms", frame.swap->skew_ms}};
  return record;
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

std::string to_json(const FrameRecord& frame) {
  return json_of(frame).dump();
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

}  // namespace hpr
