#include "walls/config/wall_schema.h"

#include <cstdint>
#include <utility>
#include <vector>

#include "core/json.h"
#include "walls/config/wall.h"
#include "walls/config/wall_draft.h"
#include "walls/config/wall_file.h"

namespace hpr {
namespace {

using Properties = std::vector<std::pair<std::string, Json>>;

constexpr double kMetresLimit = 1e6;

/// Valid, whatever it is: what no part of the program acts on.
Json anything() {
  return true;
}

Json text() {
  return {{"type", "string"}};
}

/// The name of a file.
Json file() {
  return {{"type", "string"}, {"minLength", 1}};
}

Json name() {
  return {{"type", "string"}, {"pattern", "^[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}$"}};
}

Json truth() {
  return {{"type", "boolean"}};
}

Json whole(std::int64_t low, std::int64_t high) {
  return {{"type", "integer"}, {"minimum", low}, {"maximum", high}};
}

Json number(double low, double high) {
  return {{"type", "number"}, {"minimum", low}, {"maximum", high}};
}

/// Above 0.
Json positive(double high) {
  return {{"type", "number"}, {"exclusiveMinimum", 0}, {"maximum", high}};
}

/// At least what a screen's side must have, in metres.
Json side() {
  return number(kSmallestSide_m, kMetresLimit);
}

Json one_of(const std::vector<std::string>& names) {
  return {{"enum", names}};
}

Json list(Json items) {
  return {{"type", "array"}, {"items", std::move(items)}};
}

Json list(Json items, std::size_t count) {
  return {{"type", "array"}, {"items", std::move(items)}, {"minItems", count}, {"maxItems", count}};
}

/// Not empty.
Json some(Json items) {
  return {{"type", "array"}, {"items", std::move(items)}, {"minItems", 1}};
}

Json point() {
  return list(number(-kMetresLimit, kMetresLimit), 3);
}

Json pixels() {
  return list(whole(1, kMostScreenSide), 2);
}

Json rect() {
  constexpr int kFar = 1 << 20;
  Json schema{{"type", "array"}, {"minItems", 4}, {"maxItems", 4}};
  schema["prefixItems"] = Json::array({whole(-kFar, kFar), whole(-kFar, kFar), whole(1, kFar), whole(1, kFar)});
  return schema;
}

/// A table with these keys, and those that start with x_.
Json table(const Properties& properties, const std::vector<std::string>& required = {}) {
  Json schema{{"type", "object"}};
  schema["properties"] = Json::object();
  for (const auto& [key, value] : properties) schema["properties"][key] = value;
  schema["patternProperties"] = {{"^x_", true}};
  schema["additionalProperties"] = false;
  if (!required.empty()) schema["required"] = required;
  return schema;
}

/// Exactly one of two keys.
Json with_either(Json schema, const char* first, const char* second) {
  for (const char* const key : {first, second}) {
    schema["oneOf"].push_back({{"required", Json::array({key})}});
  }
  return schema;
}

Json node() {
  return table(
      {{"id", name()},
       {"host", text()},
       {"ranks", whole(1, 1 << 20)},
       {"gpus",
        list(table({{"id", name()}, {"backend", anything()}, {"egl_device", anything()}, {"cpu_affinity", anything()}},
                   {"id"}))},
       {"nic", anything()}},
      {"id"});
}

Json window() {
  return table({{"id", name()},
                {"node", text()},
                {"gpu", text()},
                {"display", text()},
                {"monitor", text()},
                {"rank", whole(0, (1 << 20) - 1)},
                {"rect", rect()},
                {"fullscreen", truth()},
                {"swap_group", anything()}},
               {"id"});
}

Json channels(double low, double high) {
  return {{"anyOf", Json::array({number(low, high), list(number(low, high), 3)})}};
}

Json edge_blend() {
  const Json width = number(0.0, kMetresLimit);
  const Json told = table({{"left", width},
                           {"right", width},
                           {"bottom", width},
                           {"top", width},
                           {"auto", truth()},
                           {"gamma", positive(20)}});
  return {{"anyOf", Json::array({{{"const", "auto"}}, positive(kMetresLimit), told})}};
}

/// What a panel is sent besides the picture.
Properties look(Properties properties) {
  const Properties more{
      {"rotate", {{"enum", Json::array({0, 90, 180, 270})}}},
      {"mirror", one_of(mirror_names())},
      {"eye", one_of(eye_names())},
      {"colour",
       table({{"gamma", channels(0.05, 20.0)}, {"gain", channels(0.0, 20.0)}, {"black", channels(0.0, 1.0)}})},
      {"edge_blend_m", edge_blend()},
  };
  properties.insert(properties.end(), more.begin(), more.end());
  return properties;
}

Json grid() {
  const Json metres = number(-kMetresLimit, kMetresLimit);
  Json schema = table(
      look({{"columns", whole(1, kMostScreens)},
            {"rows", whole(1, kMostScreens)},
            {"tile_pixels", pixels()},
            {"tile_size_m", list(side(), 2)},
            {"gap_m", list(metres, 2)},
            {"column_gaps_m", list(metres)},
            {"row_gaps_m", list(metres)},
            {"centre_m", point()},
            {"windows", list(text())},
            {"panel_rotate", {{"enum", Json::array({0, 90, 180, 270})}}},
            {"curve", with_either(table({{"radius_m", positive(kMetresLimit)}, {"angle_degrees", positive(360.0)}}),
                                  "radius_m", "angle_degrees")}}),
      {"columns", "rows", "tile_pixels", "tile_size_m"});
  schema["not"] = {{"required", Json::array({"rotate", "panel_rotate"})}};
  return schema;
}

Json warp() {
  Json schema = table({{"mesh", file()}, {"blend", file()}, {"black", file()}});
  for (const char* const key : {"mesh", "blend", "black"}) {
    schema["anyOf"].push_back({{"required", Json::array({key})}});
  }
  return schema;
}

Json screen() {
  return table(look({{"id", name()},
                     {"pixels", pixels()},
                     {"corners_m", table({{"ll", point()}, {"lr", point()}, {"ul", point()}}, {"ll", "lr", "ul"})},
                     {"window", text()},
                     {"viewport", rect()},
                     {"warp", warp()},
                     {"overscan_px", anything()}}),
               {"id", "pixels", "corners_m"});
}

Json tracker() {
  const auto of_type = [](const char* type, Properties properties, std::vector<std::string> required) {
    const Properties more{{"type", {{"const", type}}}, {"sensor", anything()}, {"predict_ms", anything()}};
    properties.insert(properties.end(), more.begin(), more.end());
    required.emplace_back("type");
    return table(properties, required);
  };
  const Json lost = table({{"after_ms", whole(1, 3'600'000)}, {"then", one_of({"freeze", "rest"})}});
  Json schema;
  schema["oneOf"] =
      Json::array({of_type("file", {{"path", text()}, {"rate_hz", positive(1e6)}}, {"path"}),
                   of_type("udp", {{"address", text()}, {"port", whole(1, 65535)}, {"lost", lost}}, {"port"}),
                   of_type("vrpn", {{"address", anything()}, {"lost", anything()}}, {})});
  return schema;
}

Json viewer() {
  return table({{"id", name()},
                {"position_m", point()},
                {"ipd_m", number(0.0, 10.0)},
                {"eye_offset_m", point()},
                {"near_m", positive(kMetresLimit)},
                {"clamp_distance_m", positive(kMetresLimit)},
                {"tracker", tracker()}});
}

Json monitor() {
  return with_either(table({{"id", name()},
                            {"surface", text()},
                            {"rect", rect()},
                            {"pixels", pixels()},
                            {"node", anything()},
                            {"display", anything()},
                            {"zoom", anything()}},
                           {"id"}),
                     "rect", "pixels");
}

}  // namespace

std::string wall_schema() {
  const Json surface = with_either(
      table({{"id", name()}, {"viewer", text()}, {"grid", grid()}, {"screens", some(screen())}, {"mpcdi", anything()}}),
      "grid", "screens");
  const Json test = table({{"gap_rgba", list(whole(0, 255), 4)},
                           {"viewer_path", text()},
                           {"headless", anything()},
                           {"scale", anything()},
                           {"dump", anything()}});
  const Json wall = table({{"hpr_wall", {{"const", 1}}},
                           {"name", text()},
                           {"nodes", list(node())},
                           {"windows", list(window())},
                           {"surfaces", list(surface)},
                           {"viewers", list(viewer())},
                           {"stereo", table({{"mode", one_of(stereo_names())}})},
                           {"monitors", list(monitor())},
                           {"test", test},
                           {"sync", anything()},
                           {"render", anything()},
                           {"transport", anything()},
                           {"fault", anything()}},
                          {"hpr_wall", "surfaces"});
  Json document{{"$schema", "https://json-schema.org/draft/2020-12/schema"},
                {"title", "HPR wall file"},
                {"description", "The same data as a wall file's TOML; docs/walls.md says what the keys mean."}};
  for (const auto& [key, value] : wall.members()) document[key] = value;
  return document.dump(2) + "\n";
}

}  // namespace hpr
