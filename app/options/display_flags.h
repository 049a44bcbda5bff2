#pragma once

#include <string>
#include <string_view>

#include "app/options/globals.h"
#include "walls/displays/display.h"

namespace hpr {

/// What --display calls the display processes outside the job.
inline constexpr std::string_view kRemoteDisplay = "remote";

/// The flags that say where pictures are shown, and how.
struct DisplayFlags {
  std::string flag = "--display";
  bool outside_job = false;      ///< a display process: what is sent to display processes is no choice
  std::string display = "file";  ///< a name, or web=ADDR:PORT
  std::string output = {};       ///< a folder for `file`, and for `remote` the manifest; a file for `pipe`
  bool keep_frames = false;
  std::string pipe_to = {};
  std::string pipe_format = "y4m";
  std::string pipe_screen = {};
  int pipe_fps = 30;
  std::string pipe_timeout = "30s";

  void declare(const OptionSet& options);

  /// Throws Error (Usage) for what does not fit together.
  [[nodiscard]] DisplayOptions options(const Globals& globals) const;
  /// Throws Error (Usage) where there is none of the name. That of remote displays shows nothing here.
  [[nodiscard]] const DisplayKind& kind() const;
  [[nodiscard]] bool remote() const { return display == kRemoteDisplay; }
  [[nodiscard]] bool writes_files() const { return kind().name == "file"; }
  /// Whether stdout carries frames, and nothing else.
  [[nodiscard]] bool frames_on_stdout() const;
};

}  // namespace hpr
