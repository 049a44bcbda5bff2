#include "walls/geometry/stereo.h"

#include <algorithm>

#include "image/image.h"

namespace hpr {
namespace {

bool puts_two_on_one(StereoMode mode) {
  return mode == StereoMode::SideBySide || mode == StereoMode::TopBottom || mode == StereoMode::Anaglyph;
}

}  // namespace

bool for_other_eyes(const WallScreen& a, const WallScreen& b) {
  return a.eye != Eye::Both && b.eye != Eye::Both && a.eye != b.eye;
}

std::vector<ScreenEye> screen_eyes(const Wall& wall) {
  std::vector<ScreenEye> pictures;
  for (std::size_t i = 0; i < wall.screens.size(); ++i) {
    const WallScreen& screen = wall.screens[i];
    if (screen.eye != Eye::Both || !puts_two_on_one(wall.stereo)) {
      pictures.push_back({i, screen.eye, screen.pixels});
      continue;
    }
    Size left = screen.pixels;
    if (wall.stereo == StereoMode::SideBySide) left.width /= 2;
    if (wall.stereo == StereoMode::TopBottom) left.height /= 2;
    Size right = screen.pixels;
    if (wall.stereo == StereoMode::SideBySide) right.width -= left.width;
    if (wall.stereo == StereoMode::TopBottom) right.height -= left.height;
    pictures.push_back({i, Eye::Left, left});
    pictures.push_back({i, Eye::Right, right});
  }
  return pictures;
}

std::vector<Rect> eye_places(const Wall& wall, std::size_t screen) {
  const Size size = wall.screens.at(screen).pixels;
  std::vector<Rect> places;
  for (const ScreenEye& picture : screen_eyes(wall)) {
    if (picture.screen != screen) continue;
    if (picture.pixels == size) return {{0, 0, size.width, size.height}};
    const bool first = places.empty();
    const int x = first ? 0 : size.width - picture.pixels.width;
    const int y = first ? 0 : size.height - picture.pixels.height;
    places.push_back({x, y, x + picture.pixels.width, y + picture.pixels.height});
  }
  return places;
}

Image<Rgba8> compose_eyes(StereoMode mode, const Image<Rgba8>& left, const Image<Rgba8>& right) {
  HPR_CHECK(puts_two_on_one(mode));
  if (mode == StereoMode::SideBySide) {
    HPR_CHECK(left.height() == right.height());
    Image<Rgba8> result({left.width() + right.width(), left.height()});
    paste(left, 0, 0, result);
    paste(right, left.width(), 0, result);
    return result;
  }
  if (mode == StereoMode::TopBottom) {
    HPR_CHECK(left.width() == right.width());
    Image<Rgba8> result({left.width(), left.height() + right.height()});
    paste(left, 0, 0, result);
    paste(right, 0, left.height(), result);
    return result;
  }
  HPR_CHECK(left.size() == right.size());
  Image<Rgba8> result = right;
  std::ranges::transform(left.pixels(), right.pixels(), result.pixels().begin(), [](Rgba8 l, Rgba8 r) {
    return Rgba8{l.r, r.g, r.b, r.a};
  });
  return result;
}

std::vector<Image<Rgba8>> compose_screens(const Wall& wall, std::vector<Image<Rgba8>> pictures) {
  const std::vector<ScreenEye> eyes = screen_eyes(wall);
  HPR_CHECK(eyes.size() == pictures.size());
  std::vector<Image<Rgba8>> screens(wall.screens.size());
  for (std::size_t i = 0; i < eyes.size(); ++i) {
    const bool two = i + 1 < eyes.size() && eyes[i + 1].screen == eyes[i].screen;
    Image<Rgba8>& shown = screens[eyes[i].screen];
    if (!two) {
      shown = std::move(pictures[i]);
      continue;
    }
    const bool here = pictures[i].size().area() > 0 && pictures[i + 1].size().area() > 0;
    if (here) shown = compose_eyes(wall.stereo, pictures[i], pictures[i + 1]);
    ++i;
  }
  return screens;
}

}  // namespace hpr
