#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "engine/render_settings.h"
#include "engine/wall/viewpoint.h"
#include "image/image_io.h"
#include "walls/config/wall.h"
#include "walls/displays/display.h"
#include "walls/link/sender.h"

namespace hpr {

/// Files of what a wall's last frame has beside its colors, per picture of screen_eyes(); empty where none are wanted.
struct WallLayerFiles {
  std::vector<std::string> aov;  ///< DIR/SCREEN.aov.exr; DIR/SCREEN-left.aov.exr and -right where a panel takes two
  std::vector<std::string> raw;  ///< FILE where there is one picture, else FILE-SCREEN, before the extension

  [[nodiscard]] bool empty() const { return aov.empty() && raw.empty(); }
};

/// Files that a run writes at its end, beside what its display writes; empty paths are not written.
struct WallOutputs {
  std::filesystem::path manifest = {};
  std::filesystem::path assembled = {};  ///< the assembled wall, beside the file display's pictures
  std::filesystem::path picture = {};    ///< the assembled wall, once more
  std::filesystem::path stats = {};
  WallLayerFiles layers = {};
};

/// A run of a wall: the command line, resolved and checked before any rank starts to draw.
struct WallJob {
  Wall wall;
  std::string wall_file = {};    ///< as the user named it, for errors
  std::string scene = {};        ///< as `load` takes it
  RenderSettings settings = {};  ///< as they were given; those of each frame are resolve(settings, seed)
  std::uint64_t seed = 1;
  ImageLimits picture_limits = {};
  /// Loads a scene and lights it as the settings say.
  std::function<LoadedScene(const std::string& source, const RenderSettings& settings)> load = {};

  const DisplayKind* display = nullptr;  ///< not null; that of displays outside the job shows nothing here
  DisplayOptions display_options = {};
  std::optional<SenderSettings> link = {};  ///< to displays outside the job, without session, token and rank

  std::optional<int> frames = {};            ///< none: one, or until a viewer ends the run
  bool until_stopped = false;                ///< whatever shows it
  bool resume = false;                       ///< after the frames that the manifest has
  std::optional<CameraPath> path = {};       ///< of the camera; none: it stands
  std::optional<double> target_ms = {};      ///< of a frame
  std::optional<double> target_relmse = {};  ///< estimated, at which a frame has enough samples
  WallOutputs outputs = {};
  std::vector<std::string> inputs = {};                      ///< files that are read beside the scene's
  std::optional<std::chrono::nanoseconds> stall_limit = {};  ///< that the user gave, see core/job_board.h
  bool explain = false;                                      ///< print the plan of the frames
  bool summary = false;                                      ///< print what each pass did
  int restarts = 0;                                          ///< an hour, of ranks that were lost

  /// Whether it goes on until a viewer, SIGINT or SIGTERM ends it.
  [[nodiscard]] bool open_ended() const { return !frames && (until_stopped || display->interactive); }
  /// Frames of a run that is not open-ended.
  [[nodiscard]] int frame_count() const { return frames.value_or(1); }
};

/// Whether the screen is curved: a position map, not a plane, has the points of its pixels.
[[nodiscard]] inline bool has_position_map(const WallScreen& screen) {
  return screen.warp.points != nullptr;
}

/// How the frames of a run are sampled, under settings that may have changed since it began; until its target error
/// where there is one. `settings` are resolved.
[[nodiscard]] Sampling sampling_of(const WallJob& job, const RenderSettings& settings);

/// The files of a wall's layers in `folder`, and those of keys after the name `raw`; empty: none. Throws Error (Usage)
/// where the run has no last frame with a value for every pixel. `settings` are resolved.
[[nodiscard]] WallLayerFiles layer_files(const WallJob& job, const RenderSettings& settings,
                                         const std::filesystem::path& folder, const std::string& raw);

}  // namespace hpr
