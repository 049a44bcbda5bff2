#include "walls/display.h"

#include <fmt/format.h>

#include <system_error>

#include "core/check.h"
#include "core/error.h"
#include "core/file.h"
#include "core/names.h"
#include "image/image_io.h"

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
    for (const WallScreen& screen : wall.screens) check_writable(path_of(screen), options.overwrite);
  }

  [[nodiscard]] std::string_view name() const override { return "file"; }

  void show(const WallFrame& frame) override {
    for (const ScreenPicture& picture : frame.screens) {
      HPR_CHECK(picture.screen < wall_.screens.size());
      write_png(path_of(wall_.screens[picture.screen]), picture.image);
    }
  }

 private:
  [[nodiscard]] std::filesystem::path path_of(const WallScreen& screen) const { return folder_ / (screen.id + ".png"); }

  const Wall& wall_;
  std::filesystem::path folder_;
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
