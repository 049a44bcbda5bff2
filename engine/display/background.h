#pragma once

#include <string>

#include "rt/ray_settings.h"

namespace hpr {

/// "environment", "transparent" or a radiance "R,G,B". Throws Error (Usage).
[[nodiscard]] Background parse_background(const std::string& text);
/// What parse_background reads as `background`.
[[nodiscard]] std::string to_text(const Background& background);

}  // namespace hpr
