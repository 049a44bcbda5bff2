#include <fmt/format.h>

#include <map>
#include <string>
#include <system_error>

#include "core/error.h"
#include "core/file.h"
#include "core/text.h"
#include "core/timing.h"
#include "image/image_io.h"
#include "walls/displays/display.h"
#include "walls/drawing/assemble.h"
#include "walls/drawing/panel_transform.h"

namespace hpr {
namespace {

void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!error) return;
  throw Error(ExitCode::Io, fmt::format("cannot make the folder '{}': {}", folder.string(), error.message()),
              "name a folder that can be written with -o");
}

bool is_frame_folder(const std::string& name) {
  return name.starts_with("frame-") && name.find_first_not_of("0123456789", 6) == std::string::npos;
}

/// Frames of another run among this one's would pass for its own.
void refuse_kept_frames(const std::filesystem::path& folder) {
  for (const std::filesystem::path& entry : entries_of(folder)) {
    if (!is_frame_folder(entry.filename().string())) continue;
    throw Error(ExitCode::Io, fmt::format("'{}' holds frames of another run already", printable(folder.string())),
                "name an empty folder, or overwrite them with --force");
  }
}

template <typename Shown>
std::string file_of(const Shown& shown) {
  return shown.id + ".png";
}

std::string panel_file_of(const WallScreen& screen) {
  return screen.id + ".panel.png";
}

/// PNG files: folder/<screen id>.png is the latest frame, with its alpha. With keep_frames, folder/frame-000042/<screen
/// id>.png is frame 42, too. Each file is complete or untouched.
class FileDisplay final : public Display {
 public:
  FileDisplay(const Wall& wall, const DisplayOptions& options)
      : wall_(wall), folder_(options.folder.empty() ? "." : options.folder), keeps_frames_(options.keep_frames) {
    make_folder(folder_);
    for (const auto& file : files_of_display(wall, folder_)) check_writable(file, options.overwrite);
  }

  [[nodiscard]] std::string_view name() const override { return "file"; }

  [[nodiscard]] bool recovers() const override { return true; }

  void show(const WallFrame& frame) override {
    const std::filesystem::path kept = folder_ / fmt::format("frame-{:06}", frame.number);
    if (keeps_frames_ && !(frame.screens.empty() && frame.monitors.empty())) make_folder(kept);
    std::uint64_t bytes = 0;
    const auto write = [&](const std::string& file, const Image<Rgba8>& picture) {
      const std::vector<std::byte> png = encode_png(picture);
      bytes += png.size();
      write_file_atomically(folder_ / file, png);
      if (keeps_frames_) write_file_atomically(kept / file, png);
    };
    costs_.clear();
    for (const ScreenPicture& picture : frame.screens) {
      HPR_CHECK(picture.screen < wall_.screens.size());
      const Stopwatch watch;
      bytes = 0;
      // Made where it is needed: this process shows few of the wall's screens.
      const PanelTransform& panel_transform =
          panel_transforms_.try_emplace(picture.screen, wall_, picture.screen).first->second;
      const WallScreen& screen = wall_.screens[picture.screen];
      write(file_of(screen), picture.image);
      if (!panel_transform.is_identity())
        write(panel_file_of(screen), panel_transform.apply(over_black(picture.image)));
      costs_.push_back({picture.screen, watch.ms(), bytes});
    }
    for (const MonitorPicture& picture : frame.monitors) {
      write(file_of(wall_.monitors.at(picture.monitor)), picture.image);
    }
  }

  [[nodiscard]] std::vector<ScreenCost> costs() const override { return costs_; }

 private:
  const Wall& wall_;
  std::filesystem::path folder_;
  bool keeps_frames_;
  std::map<std::size_t, PanelTransform> panel_transforms_;  ///< by screen
  std::vector<ScreenCost> costs_;
};

std::unique_ptr<Display> make_file_display(const Wall& wall, const DisplayOptions& options) {
  return std::make_unique<FileDisplay>(wall, options);
}

void check_file_display(const Wall& wall, const DisplayOptions& options) {
  const std::filesystem::path folder = options.folder.empty() ? "." : options.folder;
  check_folder(folder);
  std::error_code error;
  if (!std::filesystem::exists(folder, error)) return;  // it will be made
  for (const auto& file : files_of_display(wall, folder)) check_writable(file, options.overwrite);
  if (options.keep_frames && !options.overwrite) refuse_kept_frames(folder);
}

}  // namespace

std::vector<std::filesystem::path> files_of_display(const Wall& wall, const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  for (const WallScreen& screen : wall.screens) {
    files.push_back(folder / file_of(screen));
    files.push_back(folder / panel_file_of(screen));
  }
  for (const WallMonitor& monitor : wall.monitors) files.push_back(folder / file_of(monitor));
  return files;
}

DisplayKind file_display() {
  return {.name = "file",
          .monitors = true,
          .shows_on_any_thread = true,
          .keeps_alpha = [](const DisplayOptions&) { return true; },
          .make = make_file_display,
          .check = check_file_display};
}

}  // namespace hpr
