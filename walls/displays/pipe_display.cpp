#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "core/error.h"
#include "core/file.h"
#include "core/text.h"
#include "walls/displays/display.h"
#include "walls/displays/pipe_stream.h"
#include "walls/drawing/assemble.h"

namespace hpr {
namespace {

std::optional<std::size_t> screen_of(const Wall& wall, const std::string& id) {
  if (id.empty()) return std::nullopt;
  const auto found = std::ranges::find(wall.screens, id, &WallScreen::id);
  if (found != wall.screens.end()) return static_cast<std::size_t>(found - wall.screens.begin());
  std::vector<std::string> ids;
  for (const WallScreen& screen : wall.screens) ids.push_back(screen.id);
  throw Error(ExitCode::Usage, fmt::format("the wall has no screen '{}'", printable(id)), unknown_name_hint(id, ids));
}

Sink open_sink(const PipeOptions& options) {
  return options.command.empty() ? Sink::to_file(options.file, options.time_limit)
                                 : Sink::to_command(options.command, options.time_limit);
}

/// Frames as raw RGBA or YUV4MPEG2, one after the other, to another program: the assembled wall with its gaps, or one
/// screen. Every frame has the size of the first.
class PipeDisplay final : public Display {
 public:
  PipeDisplay(const Wall& wall, const PipeOptions& options)
      : wall_(wall),
        format_(options.format),
        screen_(screen_of(wall, options.screen)),
        picture_(wall_picture(wall, kMaxPictureSide)),
        latest_(wall.screens.size()),
        sink_(open_sink(options)) {
    if (screen_) latest_[*screen_] = Image<Rgba8>(wall.screens[*screen_].pixels, {0, 0, 0, 255});
    if (format_ == PipeFormat::Rgba) return;
    const std::string header =
        y4m_header(screen_ ? wall.screens[*screen_].pixels : picture_.size, options.frames_per_second);
    const auto bytes = std::as_bytes(std::span(header));
    bytes_.assign(bytes.begin(), bytes.end());
  }

  [[nodiscard]] std::string_view name() const override { return "pipe"; }

  void show(const WallFrame& frame) override {
    for (const ScreenPicture& picture : frame.screens) {
      if (!screen_ || picture.screen == *screen_) latest_.at(picture.screen) = picture.image;
    }
    if (screen_) {
      write(latest_[*screen_]);
    } else {
      write(draw_wall(wall_, picture_, latest_));
    }
  }

  void finish() override { sink_.finish(); }

 private:
  void write(const Image<Rgba8>& image) {
    if (format_ == PipeFormat::Rgba) {
      sink_.write(std::as_bytes(image.pixels()));
      return;
    }
    append_y4m_frame(image, bytes_);
    sink_.write(bytes_);
    bytes_.clear();
  }

  const Wall& wall_;
  PipeFormat format_;
  std::optional<std::size_t> screen_;
  WallPicture picture_;
  std::vector<Image<Rgba8>> latest_;  ///< per screen, as a frame need not have all; what has none yet is black
  Sink sink_;
  std::vector<std::byte> bytes_;  ///< the stream's header before its first frame; reused
};

std::unique_ptr<Display> make_pipe_display(const Wall& wall, const DisplayOptions& options) {
  return std::make_unique<PipeDisplay>(wall, options.pipe);
}

void check_pipe_display(const Wall& wall, const DisplayOptions& options) {
  const PipeOptions& pipe = options.pipe;
  if (pipe.command.empty() == pipe.file.empty()) {
    throw Error(ExitCode::Usage, "the pipe display writes to one program, or to one file",
                "give it --pipe-to 'COMMAND', or -o FILE, or -o - for standard output");
  }
  (void)screen_of(wall, pipe.screen);
  if (pipe.file.empty() || pipe.file == "-") return;
  std::error_code error;
  const auto status = std::filesystem::status(pipe.file, error);
  if (std::filesystem::is_directory(status)) {
    throw Error(ExitCode::Io, fmt::format("cannot write frames to '{}': it is a folder", pipe.file.string()),
                "name a file or a FIFO");
  }
  const bool stream = std::filesystem::exists(status) && !std::filesystem::is_regular_file(status);
  if (!stream) check_writable(pipe.file, options.overwrite);
}

}  // namespace

PipeFormat parse_pipe_format(const std::string& name) {
  const std::vector<std::string> names{"rgba", "y4m"};
  if (name == names[0]) return PipeFormat::Rgba;
  if (name == names[1]) return PipeFormat::Y4m;
  throw Error(ExitCode::Usage, fmt::format("unknown pipe format '{}'", printable(name)),
              unknown_name_hint(name, names));
}

DisplayKind pipe_display() {
  return {.name = "pipe",
          .whole_wall = true,
          .shows_on_any_thread = true,
          .stream = true,
          .keeps_alpha = [](const DisplayOptions& options) { return options.pipe.format == PipeFormat::Rgba; },
          .make = make_pipe_display,
          .check = check_pipe_display};
}

}  // namespace hpr
