#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "image/color.h"
#include "image/image.h"

namespace hpr {

/// The first line of a YUV4MPEG2 stream of 4:4:4 pictures, progressive, square pixels.
[[nodiscard]] std::string y4m_header(Size size, int frames_per_second);

/// One frame of the stream appended to `bytes`: its line "FRAME", then the planes Y, Cb and Cr, row 0 at the top. The
/// matrix is BT.709's (ITU-R BT.709-6, item 3) on the display values as they are, i.e. with sRGB's transfer function;
/// 0 to 255 becomes 16 to 235 for Y and 16 to 240 for Cb and Cr, each rounded to the nearest. Alpha is left out. Read
/// back exactly, red and green are off by at most 1 level, blue by 2 (docs/walls.md).
void append_y4m_frame(const Image<Rgba8>& image, std::vector<std::byte>& bytes);

}  // namespace hpr
