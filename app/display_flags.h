#pragma once

#include <CLI/App.hpp>
#include <string>

#include "app/command.h"
#include "walls/display.h"

namespace hpr {

/// The flags that say where pictures are shown, and how.
struct DisplayFlags {
  std::string display = "file";  ///< a name, or web=ADDR:PORT
  std::string output;            ///< a folder for `file`, a file for `pipe`
  bool keep_frames = false;
  std::string pipe_to;
  std::string pipe_format = "y4m";
  std::string pipe_screen;
  int pipe_fps = 30;
  std::string pipe_timeout = "30s";

  void declare(CLI::App& app);

  /// Throws Error (Usage) for what does not fit together.
  [[nodiscard]] DisplayOptions options(const Globals& globals) const;
  /// Throws Error (Usage) where there is none of the name.
  [[nodiscard]] const DisplayKind& kind() const;
  /// Whether stdout carries frames, and nothing else.
  [[nodiscard]] bool frames_on_stdout() const;
};

}  // namespace hpr
