#pragma once

#include <cstddef>
#include <cstdint>

#include "image/color.h"
#include "image/image.h"
#include "walls/config/wall.h"

namespace hpr {

/// A calibration picture for one screen, upright, in its own pixels: its id and size, the outermost pixels in white, a
/// grid of one pixel width every 64 pixels, a gray ramp, one-pixel checkers in the corners, an arrow that points up,
/// arrows to the neighbours with their ids, rulers in millimetres from the left and the top of the lit area, who drives
/// it and at which output; room for draw_frame_counter; and a circle and two diagonals that belong to all screens of
/// the plane and run on behind the gaps. Throws Error (Limit) for a screen beyond 32767 pixels a side.
[[nodiscard]] Image<Rgba8> wall_pattern(const Wall& wall, std::size_t screen);

/// Draws the number of a frame into a pattern, over the one before: 16 bars, white for 1 and black for 0, the highest
/// bit at the left, and the number itself. In a photograph of two screens the bars show whether both have the same
/// frame.
void draw_frame_counter(Image<Rgba8>& pattern, std::uint64_t frame);

/// Bar `bit` (0 is the lowest, the rightmost) of a pattern of this size, in its pixels; empty where it is too small.
[[nodiscard]] Rect frame_counter_bar(Size pattern, int bit);

inline constexpr int kFrameCounterBits = 16;

}  // namespace hpr
