#include <fmt/format.h>

#include <algorithm>

#include "core/text.h"
#include "walls/config/wall_draft.h"

namespace hpr {
namespace {

constexpr double kMetresLimit = 1e6;

/// One number for all three channels, or [red, green, blue]; each in (low, high], or `low` itself where it is allowed.
std::optional<glm::dvec3> read_channels(TableReader& reader, std::string_view key, double low, double high) {
  const TomlValue* const value = reader.find(key);
  if (value == nullptr) return std::nullopt;
  const bool one = value->type == TomlValue::Type::Integer || value->type == TomlValue::Type::Real;
  const auto channels = one ? std::optional(glm::dvec3(value->real)) : reader.point(key);
  if (!channels) return std::nullopt;
  for (int i = 0; i < 3; ++i) {
    if ((*channels)[i] >= low && (*channels)[i] <= high) continue;
    reader.error(key, fmt::format("holds {}", (*channels)[i]),
                 fmt::format("one number, or [red, green, blue], each from {} to {}", low, high));
    return std::nullopt;
  }
  return channels;
}

PanelColor read_color(const TomlValue& table, Findings& findings) {
  constexpr double kSmallest = 0.05;
  constexpr double kLargest = 20.0;
  TableReader reader(table, "colour", findings);
  PanelColor color;
  color.gamma = read_channels(reader, "gamma", kSmallest, kLargest).value_or(color.gamma);
  color.gain = read_channels(reader, "gain", 0.0, kLargest).value_or(color.gain);
  color.black = read_channels(reader, "black", 0.0, 1.0).value_or(color.black);
  reader.finish();
  return color;
}

/// "auto", a width for all sides, or a table.
EdgeBlend read_blend(TableReader& reader, Findings& findings) {
  EdgeBlend blend;
  const TomlValue* const value = reader.find("edge_blend_m");
  if (value == nullptr) return blend;
  if (value->type == TomlValue::Type::Text) {
    blend.automatic = value->text == "auto";
    if (!blend.automatic) {
      reader.error("edge_blend_m", fmt::format("is \"{}\"", printable(value->text)),
                   "write \"auto\", or { left = 0.1, right = 0.1, top = 0.0, bottom = 0.0 } in metres");
    }
    return blend;
  }
  if (value->type != TomlValue::Type::Table) {
    const double width = reader.real("edge_blend_m", 0.0, kMetresLimit).value_or(0.0);
    blend.left = blend.right = blend.bottom = blend.top = width;
    return blend;
  }
  TableReader sides(*value, "edge_blend_m", findings);
  blend.automatic = sides.boolean("auto").value_or(false);
  const std::pair<std::string_view, double*> widths[] = {
      {"left", &blend.left}, {"right", &blend.right}, {"bottom", &blend.bottom}, {"top", &blend.top}};
  for (const auto& [side, width] : widths) {
    if (!sides.has(side)) continue;
    *width = sides.real_from(side, 0.0, kMetresLimit).value_or(0.0);
    if (blend.automatic && *width > 0.0) {
      sides.error(side, "stands beside auto", "either auto = true, or the width of each side");
    }
  }
  blend.gamma = sides.real("gamma", 0.0, 20.0).value_or(1.0);
  sides.finish();
  return blend;
}

}  // namespace

void read_look(TableReader& reader, std::string_view turn, WallScreen& screen, Findings& findings) {
  screen.rotate = reader.integer(turn, 0, 270).value_or(0);
  if (screen.rotate % 90 != 0) {
    reader.error(turn, fmt::format("is {}", screen.rotate), "a panel is turned by 0, 90, 180 or 270 degrees");
    screen.rotate = 0;
  }
  screen.mirror = static_cast<Mirror>(reader.choice("mirror", mirror_names()).value_or(0));
  screen.eye = static_cast<Eye>(reader.choice("eye", eye_names()).value_or(0));
  if (const TomlValue* const table = reader.table("colour")) screen.color = read_color(*table, findings);
  screen.blend = read_blend(reader, findings);
}

}  // namespace hpr
