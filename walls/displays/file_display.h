#pragma once

#include "walls/displays/display.h"

namespace hpr {

/// PNG files: folder/<screen id>.png is the latest frame. With keep_frames, folder/frame-000042/<screen id>.png is
/// frame 42, too. Each file is complete or untouched.
[[nodiscard]] std::unique_ptr<Display> make_file_display(const Wall& wall, const DisplayOptions& options);
/// The files of the latest frame.
[[nodiscard]] std::vector<std::filesystem::path> files_of_display(const Wall& wall,
                                                                  const std::filesystem::path& folder);
/// Throws what making the display would; makes nothing.
void check_file_display(const Wall& wall, const DisplayOptions& options);

}  // namespace hpr
