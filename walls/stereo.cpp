#include "walls/stereo.h"

#include <algorithm>

namespace hpr {
namespace {

bool puts_two_on_one(StereoMode mode) {
  return mode == StereoMode::SideBySide || mode == StereoMode::TopBottom || mode == StereoMode::Anaglyph;
}

void paste(const Image<Rgba8>& source, Image<Rgba8>& target, int x, int y) {
  for (int row = 0; row < source.height(); ++row) {
    std::ranges::copy(source.row(row), target.row(y + row).begin() + x);
  }
}

}  // namespace

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

Image<Rgba8> compose_eyes(StereoMode mode, const Image<Rgba8>& left, const Image<Rgba8>& right) {
  HPR_CHECK(puts_two_on_one(mode));
  if (mode == StereoMode::SideBySide) {
    HPR_CHECK(left.height() == right.height());
    Image<Rgba8> result({left.width() + right.width(), left.height()});
    paste(left, result, 0, 0);
    paste(right, result, left.width(), 0);
    return result;
  }
  if (mode == StereoMode::TopBottom) {
    HPR_CHECK(left.width() == right.width());
    Image<Rgba8> result({left.width(), left.height() + right.height()});
    paste(left, result, 0, 0);
    paste(right, result, 0, left.height());
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
