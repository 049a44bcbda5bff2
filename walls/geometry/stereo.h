#pragma once

#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "walls/config/wall.h"

namespace hpr {

/// A picture to draw: of a screen, for an eye.
struct ScreenEye {
  std::size_t screen = 0;  ///< index into Wall::screens
  Eye eye = Eye::Both;
  Size pixels;

  bool operator==(const ScreenEye&) const = default;
};

/// Whether each of the two screens is for an eye of its own.
[[nodiscard]] bool for_other_eyes(const WallScreen& a, const WallScreen& b);

/// The pictures a wall needs, screen after screen: one each, but the left and then the right eye's of screens for both
/// where the stereo mode puts two pictures on one panel. Side by side and above each other each has half of the
/// screen's pixels, the left (upper) one the smaller half.
[[nodiscard]] std::vector<ScreenEye> screen_eyes(const Wall& wall);

/// Which parts of a screen's pixels its pictures take, in the order of screen_eyes(); one part where they share it.
[[nodiscard]] std::vector<Rect> eye_places(const Wall& wall, std::size_t screen);

/// What the screen shows of two eyes' pictures of the sizes of screen_eyes(). Anaglyph: red of the left eye, green and
/// blue of the right one.
[[nodiscard]] Image<Rgba8> compose_eyes(StereoMode mode, const Image<Rgba8>& left, const Image<Rgba8>& right);

/// Per screen what it shows, of the pictures of screen_eyes(); empty where one of them is.
[[nodiscard]] std::vector<Image<Rgba8>> compose_screens(const Wall& wall, std::vector<Image<Rgba8>> pictures);

}  // namespace hpr
