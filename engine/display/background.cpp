#include "engine/display/background.h"

#include <fmt/format.h>

#include <optional>

#include "core/error.h"
#include "core/text.h"
#include "scene/load_scene.h"

namespace hpr {

Background parse_background(const std::string& text) {
  if (text == "environment") return {};
  if (text == "transparent") return {Background::Kind::Transparent, {}};
  if (const auto color = parse_radiance(text)) return {Background::Kind::Color, *color};
  throw Error(ExitCode::Usage, fmt::format("'{}' is no background", printable(text)),
              "write environment, transparent, or a radiance such as 1,1,1");
}

std::string to_text(const Background& background) {
  switch (background.kind) {
    case Background::Kind::Environment:
      return "environment";
    case Background::Kind::Transparent:
      return "transparent";
    case Background::Kind::Color:
      return fmt::format("{},{},{}", background.color.r, background.color.g, background.color.b);
  }
  return {};
}

}  // namespace hpr
