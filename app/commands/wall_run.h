#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/options/display_options.h"
#include "app/options/globals.h"
#include "app/options/option_set.h"
#include "app/options/render_options.h"
#include "engine/wall/wall_job.h"

/// Options that several commands of walls have.
namespace hpr {

/// A run of a wall as the command line has it: what `wall run`, `view` and `demo` share.
struct WallRun {
  std::string scene;
  std::string wall;
  std::vector<std::string> overrides = {};  ///< of the wall file, PATH=VALUE
  DisplayFlags display = {};
  std::string raw = {};                     ///< keys of the last frame; see WallLayerFiles
  std::string picture = {};                 ///< the assembled wall goes here too; empty: only into the folder
  double scale = 1.0;                       ///< of the screens' pixels
  std::optional<int> frames = {};           ///< none: one, or until a viewer ends the run
  std::string path = {};                    ///< file of the camera's path; empty: it stands
  std::optional<double> target_ms = {};     ///< of a frame
  std::optional<double> target_error = {};  ///< estimated relMSE at which a frame has enough samples
  bool until_stopped = false;               ///< whatever shows it
  bool resume = false;                      ///< after the frames the folder's manifest has
  int restarts = 3;                         ///< an hour, of ranks that were lost
  bool summary = false;                     ///< print what each pass did
  LinkOptions link = {};
  RenderSettings settings = {};
  ReportOptions report = {};
};

/// What the command line means, typed and checked. Creates nothing. Throws Error.
[[nodiscard]] WallJob make_wall_job(const WallRun& run, const Globals& globals);

/// Draws a job on all ranks. Throws Error, before any rank draws, where its results cannot be written.
[[nodiscard]] ExitCode run_wall(WallJob job, Globals globals);

/// The wall itself, a required positional.
void declare_wall(const OptionSet& options, std::string& wall);

/// `--set PATH=VALUE`, as often as wanted.
void declare_overrides(const OptionSet& options, std::vector<std::string>& overrides);

/// `--target-ms`: milliseconds, or another unit that is named.
void declare_target_ms(const OptionSet& options, std::optional<double>& target_ms, const std::string& text);

}  // namespace hpr
