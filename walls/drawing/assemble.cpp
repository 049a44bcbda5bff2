#include "walls/drawing/assemble.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/error.h"
#include "image/image.h"
#include "walls/geometry/geometry.h"

namespace hpr {
namespace {

/// What one target pixel covers of a source axis.
struct Taps {
  int first = 0;
  std::vector<float> weights;  ///< sum 1
};

std::vector<Taps> make_taps(int from, int to) {
  std::vector<Taps> taps(static_cast<std::size_t>(to));
  const double ratio = static_cast<double>(from) / to;
  for (int i = 0; i < to; ++i) {
    const double begin = i * ratio;
    const double end = (i + 1) * ratio;
    const int first = std::min(static_cast<int>(begin), from - 1);
    const int last = std::clamp(static_cast<int>(std::ceil(end)) - 1, first, from - 1);
    Taps& tap = taps[static_cast<std::size_t>(i)];
    tap.first = first;
    double sum = 0.0;
    for (int x = first; x <= last; ++x) {
      const double covered = std::min(end, x + 1.0) - std::max(begin, static_cast<double>(x));
      tap.weights.push_back(static_cast<float>(std::max(covered, 0.0)));
      sum += std::max(covered, 0.0);
    }
    for (float& weight : tap.weights) weight = sum > 0.0 ? weight / static_cast<float>(sum) : 1.0F;
  }
  return taps;
}

std::array<float, 256> linear_levels() {
  std::array<float, 256> levels{};
  for (std::size_t i = 0; i < levels.size(); ++i) levels[i] = srgb_to_linear(static_cast<std::uint8_t>(i));
  return levels;
}

/// The surface alone.
Wall surface_of(const Wall& wall, const std::string& surface, std::vector<std::size_t>& indices) {
  const auto on_it = [&](const WallScreen& screen) { return screen.surface == surface; };
  const bool any_other = std::ranges::any_of(
      wall.screens, [&](const WallScreen& screen) { return on_it(screen) && screen.eye != Eye::Right; });
  Wall part = wall;
  part.screens.clear();
  for (std::size_t i = 0; i < wall.screens.size(); ++i) {
    const WallScreen& screen = wall.screens[i];
    if (!on_it(screen) || (any_other && screen.eye == Eye::Right)) continue;
    part.screens.push_back(screen);
    indices.push_back(i);
  }
  return part;
}

}  // namespace

Image<Rgba8> resample(const Image<Rgba8>& image, Size size) {
  HPR_CHECK(image.size().area() > 0 && size.area() > 0);
  if (image.size() == size) return image;
  const std::array<float, 256> linear = linear_levels();
  const std::vector<Taps> across = make_taps(image.width(), size.width);
  const std::vector<Taps> down = make_taps(image.height(), size.height);
  Image<Rgba8> result(size);
  struct Sum {
    Rgb color;               // multiplied by alpha
    float uncovered = 0.0F;  // exactly 0 of opaque pixels, whatever rounding makes of the weights' sum
  };
  std::vector<Sum> sums(static_cast<std::size_t>(size.width));
  for (int y = 0; y < size.height; ++y) {
    std::ranges::fill(sums, Sum{});
    const Taps& rows = down[static_cast<std::size_t>(y)];
    for (std::size_t j = 0; j < rows.weights.size(); ++j) {
      const auto source = image.row(rows.first + static_cast<int>(j));
      for (std::size_t x = 0; x < sums.size(); ++x) {
        const Taps& columns = across[x];
        for (std::size_t i = 0; i < columns.weights.size(); ++i) {
          const Rgba8 pixel = source[static_cast<std::size_t>(columns.first) + i];
          const float weight = rows.weights[j] * columns.weights[i];
          const float alpha = static_cast<float>(pixel.a) / 255.0F;
          sums[x].color.r += alpha * weight * linear[pixel.r];
          sums[x].color.g += alpha * weight * linear[pixel.g];
          sums[x].color.b += alpha * weight * linear[pixel.b];
          sums[x].uncovered += weight * (1.0F - alpha);
        }
      }
    }
    std::ranges::transform(sums, result.row(y).begin(), [](const Sum& sum) {
      const float alpha = std::clamp(1.0F - sum.uncovered, 0.0F, 1.0F);
      if (alpha == 0.0F) return Rgba8{};
      Rgba8 color = to_srgb({sum.color.r / alpha, sum.color.g / alpha, sum.color.b / alpha});
      color.a = static_cast<std::uint8_t>(std::lround(255.0F * alpha));
      return color;
    });
  }
  return result;
}

Image<Rgba8> over_black(Image<Rgba8> image) {
  for (Rgba8& pixel : image.pixels()) {
    if (pixel.a == 255) continue;
    const Rgb color = from_srgb(pixel);
    const float alpha = static_cast<float>(pixel.a) / 255.0F;
    pixel = to_srgb({alpha * color.r, alpha * color.g, alpha * color.b});
  }
  return image;
}

Image<Rgba8> draw_wall(const Wall& wall, const WallPicture& picture, std::span<const Image<Rgba8>> screens) {
  std::vector<const Image<Rgba8>*> pointers;
  pointers.reserve(screens.size());
  for (const Image<Rgba8>& screen : screens) pointers.push_back(&screen);
  return draw_wall(wall, picture, pointers);
}

Image<Rgba8> draw_wall(const Wall& wall, const WallPicture& picture, std::span<const Image<Rgba8>* const> screens) {
  HPR_CHECK(screens.size() == wall.screens.size() && screens.size() == picture.screens.size());
  Image<Rgba8> result(picture.size, wall.gap_color);
  for (const bool right_eye : {true, false}) {
    for (std::size_t i = 0; i < screens.size(); ++i) {
      if ((wall.screens[i].eye == Eye::Right) != right_eye) continue;
      const Rect rect = picture.screens[i];
      const Size size{rect.width(), rect.height()};
      const bool there = screens[i] != nullptr && screens[i]->size().area() > 0;
      const Image<Rgba8> shown = there ? resample(*screens[i], size) : Image<Rgba8>(size, {0, 0, 0, 255});
      paste(shown, rect.x0, rect.y0, result);
    }
  }
  return result;
}

Image<Rgba8> turn_clockwise(const Image<Rgba8>& image, int degrees) {
  HPR_CHECK(degrees >= 0 && degrees < 360 && degrees % 90 == 0);
  const int w = image.width();
  const int h = image.height();
  Image<Rgba8> result(degrees % 180 == 0 ? Size{w, h} : Size{h, w});
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x) {
      const Rgba8 pixel = image.at(x, y);
      if (degrees == 0) result.at(x, y) = pixel;
      if (degrees == 90) result.at(h - 1 - y, x) = pixel;
      if (degrees == 180) result.at(w - 1 - x, h - 1 - y) = pixel;
      if (degrees == 270) result.at(y, w - 1 - x) = pixel;
    }
  }
  return result;
}

MonitorLayout monitor_layout(const Wall& wall, const WallMonitor& monitor) {
  // Finer than any monitor, so that scaling its whole pixels rounds to the right ones.
  constexpr int kFine = 1 << 24;
  MonitorLayout layout;
  const Wall part = surface_of(wall, monitor.surface, layout.screens);
  HPR_CHECK(!part.screens.empty());
  const WallPicture picture = wall_picture(part, kFine);
  const double scale = std::min(static_cast<double>(monitor.pixels.width) / picture.size.width,
                                static_cast<double>(monitor.pixels.height) / picture.size.height);
  const double left = 0.5 * (monitor.pixels.width - scale * picture.size.width);
  const double top = 0.5 * (monitor.pixels.height - scale * picture.size.height);
  const auto scaled = [&](const Rect& rect) {
    const auto edge = [](double at, int most) { return std::clamp(static_cast<int>(std::lround(at)), 0, most); };
    Rect result;
    result.x0 = edge(left + scale * rect.x0, monitor.pixels.width - 1);
    result.y0 = edge(top + scale * rect.y0, monitor.pixels.height - 1);
    result.x1 = std::max(result.x0 + 1, edge(left + scale * rect.x1, monitor.pixels.width));
    result.y1 = std::max(result.y0 + 1, edge(top + scale * rect.y1, monitor.pixels.height));
    return result;
  };
  layout.surface = scaled({0, 0, picture.size.width, picture.size.height});
  std::ranges::transform(picture.screens, std::back_inserter(layout.rects), scaled);
  return layout;
}

Image<Rgba8> draw_monitor(const Wall& wall, const WallMonitor& monitor, const MonitorLayout& layout,
                          std::span<const Image<Rgba8>> pictures) {
  HPR_CHECK(pictures.size() == layout.rects.size());
  Image<Rgba8> result(monitor.pixels, {0, 0, 0, 255});
  const Rect& surface = layout.surface;
  paste(Image<Rgba8>({surface.width(), surface.height()}, wall.gap_color), surface.x0, surface.y0, result);
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const Rect& rect = layout.rects[i];
    if (pictures[i].size().area() == 0) continue;
    paste(over_black(resample(pictures[i], {rect.width(), rect.height()})), rect.x0, rect.y0, result);
  }
  return result;
}

}  // namespace hpr
