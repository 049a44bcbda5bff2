#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/file.h"
#include "image/color.h"
#include "image/image.h"

namespace hpr {

/// Where a stream of bytes goes: a command's standard input, a file, a FIFO or standard output. No call waits longer
/// than the time limit for a reader that takes nothing: then, as when it went away, it throws Error (Io).
class Sink {
 public:
  /// Starts `command` by /bin/sh, in a process group of its own: what interrupts hpr leaves it to end by itself.
  [[nodiscard]] static Sink to_command(const std::string& command, std::chrono::milliseconds time_limit);
  /// "-" is standard output. A FIFO is waited for until somebody reads it. A regular file appears under its name when
  /// finish() was called.
  [[nodiscard]] static Sink to_file(const std::filesystem::path& path, std::chrono::milliseconds time_limit);

  Sink(Sink&& other) noexcept;
  Sink& operator=(Sink&&) = delete;
  Sink(const Sink&) = delete;
  Sink& operator=(const Sink&) = delete;
  /// Removes an unfinished file and ends the command where finish() was not called.
  ~Sink();

  void write(std::span<const std::byte> bytes);
  /// All is written: a file gets its name, a command is waited for and must leave with 0.
  void finish();

 private:
  Sink(std::string name, std::chrono::milliseconds time_limit) : name_(std::move(name)), time_limit_(time_limit) {}

  void wait_until_writable() const;
  void close();
  /// Its wait status, once it has left within the time; -1: it still runs.
  [[nodiscard]] int wait_for_child(std::chrono::milliseconds limit);
  [[noreturn]] void fail(int error);

  std::string name_;  ///< for errors
  std::chrono::milliseconds time_limit_;
  int file_ = -1;
  bool owned_ = true;                     ///< closed here, and never blocks
  pid_t child_ = 0;                       ///< 0: none, or waited for
  std::optional<AtomicFile> unfinished_;  ///< a regular file; it closes `file_`
};

/// The first line of a YUV4MPEG2 stream of 4:4:4 pictures, progressive, square pixels.
[[nodiscard]] std::string y4m_header(Size size, int frames_per_second);

/// One frame of the stream appended to `bytes`: its line "FRAME", then the planes Y, Cb and Cr, row 0 at the top. The
/// matrix is BT.709's (ITU-R BT.709-6, item 3) on the display values as they are, i.e. with sRGB's transfer function;
/// 0 to 255 becomes 16 to 235 for Y and 16 to 240 for Cb and Cr, each rounded to the nearest. Alpha is left out. Read
/// back exactly, red and green are off by at most 1 level, blue by 2 (docs/walls.md).
void append_y4m_frame(const Image<Rgba8>& image, std::vector<std::byte>& bytes);

}  // namespace hpr
