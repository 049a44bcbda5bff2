#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/command.h"
#include "app/commands/remote_wall.h"
#include "app/options/display_flags.h"
#include "app/options/render_options.h"
#include "walls/config/wall.h"

namespace CLI {
class App;
}  // namespace CLI

namespace hpr {

/// Driving a wall from a scene, as `wall run` and `demo --wall` do it.
struct WallRun {
  std::string scene;
  std::string wall;
  std::vector<std::string> overrides;  ///< of the wall file, PATH=VALUE
  DisplayFlags display;
  std::string raw;                     ///< keys of the last frame; see WallLayers
  std::string picture;                 ///< the assembled wall goes here too; empty: only into the folder
  double scale = 1.0;                  ///< of the screens' pixels
  std::optional<int> frames;           ///< none: one, or until a viewer ends the run
  std::string path;                    ///< of the camera; empty: it stands
  std::optional<double> target_ms;     ///< of a frame
  std::optional<double> target_error;  ///< estimated relMSE at which a frame has enough samples
  bool until_stopped = false;          ///< whatever shows it
  bool resume = false;                 ///< after the frames the folder's manifest has
  int restarts = 3;                    ///< of a job of several ranks that was lost
  bool summary = false;                ///< say on stdout what each pass did
  RemoteOptions remote;
  RenderOptions options;

  /// Whether it goes on until a viewer, SIGINT or SIGTERM ends it.
  [[nodiscard]] bool open_ended() const { return !frames && (until_stopped || display.kind().interactive); }
  /// Where its manifest goes; empty: it writes none.
  [[nodiscard]] std::filesystem::path manifest() const {
    return writes_files() || (display.remote() && !display.output.empty())
               ? std::filesystem::path(display.output) / "manifest.json"
               : std::filesystem::path();
  }
  [[nodiscard]] bool writes_files() const { return display.kind().name == "file"; }
};

/// Checks what can be checked alone, then draws on all ranks.
[[nodiscard]] ExitCode run_wall(const WallRun& run, const Globals& globals);

/// `--set PATH=VALUE`, as often as wanted.
void declare_overrides(CLI::App& app, std::vector<std::string>& overrides);

/// `--target-ms`: milliseconds, or another unit that is named.
void declare_target_ms(CLI::App& app, std::optional<double>& target_ms, const std::string& text);

/// `hpr wall run WALL SCENE`.
[[nodiscard]] std::unique_ptr<Command> make_wall_run_command();

}  // namespace hpr
