#include "walls/display.h"

#include <fmt/format.h>

#include <map>
#include <system_error>

#include "core/check.h"
#include "core/error.h"
#include "core/file.h"
#include "core/names.h"
#include "image/image_io.h"
#include "walls/scan_out.h"

namespace hpr {
namespace {

class NoDisplay final : public Display {
 public:
  [[nodiscard]] std::string_view name() const override { return "none"; }
  void show(const WallFrame& /*frame*/) override {}
};

class FileDisplay final : public Display {
 public:
  FileDisplay(const Wall& wall, const DisplayOptions& options)
      : wall_(wall), folder_(options.folder.empty() ? "." : options.folder) {
    std::error_code error;
    std::filesystem::create_directories(folder_, error);
    if (error) {
      throw Error(ExitCode::Io, fmt::format("cannot make the folder '{}': {}", folder_.string(), error.message()),
                  "name a folder that can be written with -o");
    }
    for (const WallScreen& screen : wall.screens) check_writable(path_of(screen.id), options.overwrite);
    for (const WallMonitor& monitor : wall.monitors) check_writable(path_of(monitor.id), options.overwrite);
  }

  [[nodiscard]] std::string_view name() const override { return "file"; }

  void show(const WallFrame& frame) override {
    for (const ScreenPicture& picture : frame.screens) {
      HPR_CHECK(picture.screen < wall_.screens.size());
      // Made where it is needed: this process shows few of the wall's screens.
      const auto scan_out = scan_outs_.try_emplace(picture.screen, wall_, picture.screen).first;
      const std::filesystem::path path = path_of(wall_.screens[picture.screen].id);
      if (scan_out->second.trivial()) {
        write_png(path, picture.image);
      } else {
        write_png(path, scan_out->second.apply(picture.image));
      }
    }
    for (const MonitorPicture& picture : frame.monitors) {
      write_png(path_of(wall_.monitors.at(picture.monitor).id), picture.image);
    }
  }

 private:
  [[nodiscard]] std::filesystem::path path_of(const std::string& id) const { return folder_ / (id + ".png"); }

  const Wall& wall_;
  std::filesystem::path folder_;
  std::map<std::size_t, ScanOut> scan_outs_;  ///< by screen
};

}  // namespace

const std::vector<std::string>& all_displays() {
  static const std::vector<std::string> names{"file", "none"};
  return names;
}

std::unique_ptr<Display> make_display(std::string_view name, const Wall& wall, const DisplayOptions& options) {
  if (name == "file") return std::make_unique<FileDisplay>(wall, options);
  if (name == "none") return std::make_unique<NoDisplay>();
  throw Error(ExitCode::Usage, fmt::format("unknown display '{}'", printable(name)),
              unknown_name_hint(name, all_displays()));
}

}  // namespace hpr
