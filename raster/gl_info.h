#pragma once

#include <string>

namespace hpr {

struct GlFunctions;

/// What a context says of itself.
struct GlInfo {
  std::string renderer;
  std::string version;
  bool software = false;
};

/// Asks the current context. Throws Error (NoDevice) when it is older than OpenGL 4.5, or cannot hold the screens a
/// view may have (kRasterLimit pixels a side).
[[nodiscard]] GlInfo query_gl_info(const GlFunctions& gl);

}  // namespace hpr
