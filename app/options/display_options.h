#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "app/options/globals.h"
#include "app/options/option_set.h"
#include "engine/render_settings.h"
#include "walls/config/wall.h"
#include "walls/displays/display.h"
#include "walls/link/sender.h"

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

/// The options of `--display remote`: how a run reaches its displays, and how pictures are sent to them.
struct LinkOptions {
  std::vector<std::string> displays;  ///< HOST=ADDRESS
  std::string send_budget = "100ms";
  std::string swap_timeout = "100ms";
  int in_flight = 1;
  bool codec_deltas = false;
  std::string fail_on = "unseen";

  /// The codec is one of the `settings`, which outlive parsing.
  void declare(const OptionSet& options, RenderSettings& settings);
  /// Throws Error (Usage) when one of them was given: nothing is sent to displays.
  void refuse() const;
  /// Without session, token and rank. Throws Error (Usage, Io) for what makes no sense for this wall.
  [[nodiscard]] SenderSettings settings(const Wall& wall, const LinkCodec& codec) const;

 private:
  std::vector<Option> declared_;
};

}  // namespace hpr
