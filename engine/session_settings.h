#pragma once

#include <string>

namespace hpr {

/// What a session uses of the machine that each of its ranks runs on.
struct SessionSettings {
  std::string backend = "auto";  ///< OpenGL by it, see GlContextSettings
  int device = -1;               ///< EGL device; -1: by local rank
  int threads = 0;               ///< of one rank; 0: the machine's cores divided among the ranks of a host
};

}  // namespace hpr
