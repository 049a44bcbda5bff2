#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "walls/wall.h"

namespace hpr {

/// A screen's finished picture, upright; sRGB. A display sends its panel what ScanOut makes of it.
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

/// Shows pictures on the screens of a wall.
class Display {
 public:
  virtual ~Display() = default;

  /// The name used on the command line and in reports.
  [[nodiscard]] virtual std::string_view name() const = 0;

  /// Returns when the frame is handed over; its pictures may then change. Throws Error (Io, Lost).
  virtual void show(const WallFrame& frame) = 0;
};

struct DisplayOptions {
  std::filesystem::path folder;  ///< for `file`; made if missing
  bool overwrite = false;        ///< replace files that were there before the run
};

/// "file" (folder/<screen id>.png, what its panel is sent of the latest frame, and folder/<monitor id>.png; each file
/// complete or untouched) and "none".
[[nodiscard]] const std::vector<std::string>& all_displays();

/// Throws Error: Usage for an unknown name (with the choices), Io when the folder cannot be written or holds a picture
/// that may not be overwritten. Asked before long work. `wall` must outlive the display.
[[nodiscard]] std::unique_ptr<Display> make_display(std::string_view name, const Wall& wall,
                                                    const DisplayOptions& options);

}  // namespace hpr
