#include "walls/drawing/frame_counter.h"

#include <fmt/format.h>

#include <algorithm>

#include "image/image.h"
#include "walls/drawing/canvas.h"

namespace hpr {
namespace {

constexpr Rgba8 kBlack{0, 0, 0, 255};
constexpr Rgba8 kWhite{255, 255, 255, 255};
constexpr Rgba8 kBetween{96, 96, 96, 255};

/// Where bars and number are, of a pattern's height and width.
constexpr double kLeft = 0.1;
constexpr double kWidth = 0.8;
constexpr double kTop = 0.65;
constexpr double kBars = 0.05;
constexpr double kNumber = 0.05;

Rect all_bars(Size size) {
  const int top = static_cast<int>(kTop * size.height);
  const int left = static_cast<int>(kLeft * size.width);
  return {left, top, left + static_cast<int>(kWidth * size.width), top + static_cast<int>(kBars * size.height)};
}

void fill(Image<Rgba8>& image, const Rect& rect, Rgba8 color) {
  paste(Image<Rgba8>({rect.width(), rect.height()}, color), rect.x0, rect.y0, image);
}

}  // namespace

Rect frame_counter_bar(Size pattern, int bit) {
  const Rect all = all_bars(pattern);
  const int step = all.width() / kFrameCounterBits;
  const int inset = std::max(1, step / 8);
  const int x = all.x0 + (kFrameCounterBits - 1 - bit) * step;
  const Rect bar{x + inset, all.y0 + 1, x + step, all.y1 - 1};
  return bar.empty() ? Rect{} : bar;
}

void draw_frame_counter(Image<Rgba8>& pattern, std::uint64_t frame) {
  const Rect all = all_bars(pattern.size());
  if (frame_counter_bar(pattern.size(), 0).empty()) return;
  fill(pattern, all, kBetween);
  for (int bit = 0; bit < kFrameCounterBits; ++bit) {
    fill(pattern, frame_counter_bar(pattern.size(), bit),
         (frame >> static_cast<unsigned>(bit) & 1U) != 0 ? kWhite : kBlack);
  }
  const Size size{all.width(), static_cast<int>(kNumber * pattern.height())};
  if (size.height < 6) return;
  PixelCanvas canvas(size);
  canvas.fill({0.0, 0.0}, {size.width, size.height}, kBlack);
  canvas.text({0.5 * size.width, 0.5 * size.height}, fmt::format("frame {}", frame), 0.8 * size.height, kWhite);
  paste(canvas.image(), all.x0, all.y1, pattern);
}

}  // namespace hpr
