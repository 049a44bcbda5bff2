#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "walls/config/wall.h"

namespace hpr {

/// A screen's finished picture, upright; sRGB, with alpha where the display keeps it. A display sends its panel what
/// PanelTransform makes of it.
struct ScreenPicture {
  std::size_t screen = 0;  ///< index into Wall::screens
  const Image<Rgba8>& image;
};

/// What an operator's monitor shows.
struct MonitorPicture {
  std::size_t monitor = 0;  ///< index into Wall::monitors
  const Image<Rgba8>& image;
};

/// The pictures of one frame this process is to show: all screens, or those whose display it is.
struct WallFrame {
  std::uint64_t number = 0;
  std::span<const ScreenPicture> screens;
  std::span<const MonitorPicture> monitors = {};
};

/// What showing a screen took.
struct ScreenCost {
  std::size_t screen = 0;   ///< index into Wall::screens
  double ms = 0.0;          ///< until it was handed over: encoding, writing
  std::uint64_t bytes = 0;  ///< handed over
};

/// How the viewer moved the camera about what it looks at, summed over a while.
struct OrbitInput {
  double turn_right = 0.0;  ///< radians by which the scene turns to the right
  double turn_up = 0.0;     ///< radians by which the scene turns up
  double pan_right = 0.0;   ///< by which the picture is dragged to the right, in heights of the wall
  double pan_up = 0.0;
  double dolly = 0.0;  ///< natural logarithm of how many times nearer the camera comes

  OrbitInput& operator+=(const OrbitInput& other);
  bool operator==(const OrbitInput&) const = default;
};

/// How the viewer changed what is shown, summed over a while.
struct ViewKeys {
  int half_stops = 0;  ///< of exposure
  int tones = 0;       ///< how often the next tone was asked for
  int wireframes = 0;  ///< how often the wireframe was turned on or off

  ViewKeys& operator+=(const ViewKeys& other);
  bool operator==(const ViewKeys&) const = default;
};

/// What pressing a key means: + or = and - are half a stop each, t is the next tone, w the wireframe. None: nothing.
[[nodiscard]] std::optional<ViewKeys> parse_view_key(char key);

/// What the viewer asked for.
struct DisplayInput {
  OrbitInput orbit = {};
  ViewKeys keys = {};
  bool stop = false;  ///< end the run after this frame, orderly

  DisplayInput& operator+=(const DisplayInput& other);
  bool operator==(const DisplayInput&) const = default;
};

/// Shows pictures on the screens of a wall.
class Display {
 public:
  virtual ~Display() = default;

  /// The name used on the command line and in reports.
  [[nodiscard]] virtual std::string_view name() const = 0;

  /// Returns when the frame is handed over; its pictures may then change. Throws Error (Io, Lost).
  virtual void show(const WallFrame& frame) = 0;

  /// Whether show() may succeed again after it threw Error (Io).
  [[nodiscard]] virtual bool recovers() const { return false; }

  /// What the last frame's screens took; empty where it is not known.
  [[nodiscard]] virtual std::vector<ScreenCost> costs() const { return {}; }

  /// What the viewer asked for since this was last called; never waits.
  [[nodiscard]] virtual DisplayInput take_input() { return {}; }

  /// Called once, after the last frame of a run that ended well: what is shown is completed. Throws Error (Io).
  virtual void finish() {}
};

enum class PipeFormat : std::uint8_t { Rgba, Y4m };

/// "rgba" or "y4m". Throws Error (Usage).
[[nodiscard]] PipeFormat parse_pipe_format(const std::string& name);

/// Where the display `pipe` writes, and what.
struct PipeOptions {
  std::string command = {};         ///< run by /bin/sh, frames on its standard input; empty: `file`
  std::filesystem::path file = {};  ///< a file, a FIFO, or "-" for standard output
  PipeFormat format = PipeFormat::Y4m;
  std::string screen = {};  ///< id; empty: the assembled wall
  int frames_per_second = 30;
  std::chrono::milliseconds time_limit{30'000};  ///< without the reader taking a byte
};

struct DisplayOptions {
  std::filesystem::path folder = {};  ///< for `file`; made if missing
  bool overwrite = false;             ///< replace files that were there before the run
  bool keep_frames = false;           ///< for `file`: each frame into a folder of its own too
  PipeOptions pipe = {};
  std::optional<std::vector<std::size_t>> screens = {};  ///< for `window`: those this process shows; none: all
  std::string web_address = {};                          ///< for `web`: ADDR:PORT; empty: loopback, a free port
  std::function<void(const std::string& line)> announce = nullptr;  ///< called with the address of `web`
};

/// One way to show a wall; defined in the file of its name.
struct DisplayKind {
  std::string_view name;
  bool whole_wall = false;           ///< one process shows all screens, whichever rank the wall file names
  bool interactive = false;          ///< has a viewer who moves the camera, and who ends the run
  bool monitors = false;             ///< shows the operator's monitors too
  bool shows_on_any_thread = false;  ///< show() may run on another thread while the next frame is drawn
  bool stream = false;               ///< what it was given cannot be taken back: a job that is lost does not go on
  /// Whether it takes pictures with alpha, colours not multiplied by it; null, or false: they come before black.
  bool (*keeps_alpha)(const DisplayOptions& options) = nullptr;
  /// Throws Error: Usage for options that do not fit, Io when what is to be written to cannot be or holds what may not
  /// be overwritten, NoDevice without a desktop for windows. `wall` must outlive the display.
  std::unique_ptr<Display> (*make)(const Wall& wall, const DisplayOptions& options) = nullptr;
  /// Throws what `make` would, as far as that can be known without opening anything; asked before long work.
  void (*check)(const Wall& wall, const DisplayOptions& options) = nullptr;
};

/// Every display, in the order in which help lists them: X(file) stands for file_display.cpp, which defines
/// file_display().
#define HPR_DISPLAYS(X) \
  X(file)               \
  X(window)             \
  X(web)                \
  X(pipe)               \
  X(none)

#define HPR_DECLARE_DISPLAY(name) [[nodiscard]] DisplayKind name##_display();
HPR_DISPLAYS(HPR_DECLARE_DISPLAY)
#undef HPR_DECLARE_DISPLAY

/// "file" (of the latest frame folder/<screen id>.png, where its panel is sent another picture also
/// folder/<screen id>.panel.png, and folder/<monitor id>.png; each file complete or untouched), "window", "web", "pipe"
/// and "none".
[[nodiscard]] const std::vector<DisplayKind>& display_kinds();
[[nodiscard]] const std::vector<std::string>& all_displays();

/// Throws Error (Usage) for an unknown name, with the choices and `further` ones that the caller has.
[[nodiscard]] const DisplayKind& find_display(std::string_view name, std::span<const std::string> further = {});

/// The files of the latest frame that the display `file` writes.
[[nodiscard]] std::vector<std::filesystem::path> files_of_display(const Wall& wall,
                                                                  const std::filesystem::path& folder);

/// Whether this process can reach a desktop for windows.
[[nodiscard]] bool has_desktop();

}  // namespace hpr
