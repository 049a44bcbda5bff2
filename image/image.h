#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

#include "core/error.h"

namespace hpr {

/// A width and height in pixels (or columns and rows).
struct Size {
  int width = 0;
  int height = 0;

  [[nodiscard]] std::size_t area() const { return static_cast<std::size_t>(width) * static_cast<std::size_t>(height); }
  bool operator==(const Size&) const = default;
};

/// Pixels x0 <= x < x1, y0 <= y < y1; row 0 is the top.
struct Rect {
  int x0 = 0;
  int y0 = 0;
  int x1 = 0;
  int y1 = 0;

  [[nodiscard]] int width() const { return x1 - x0; }
  [[nodiscard]] int height() const { return y1 - y0; }
  [[nodiscard]] bool empty() const { return x1 <= x0 || y1 <= y0; }
  [[nodiscard]] std::size_t area() const {
    return empty() ? 0 : static_cast<std::size_t>(width()) * static_cast<std::size_t>(height());
  }
  bool operator==(const Rect&) const = default;
};

[[nodiscard]] constexpr Rect intersection(const Rect& a, const Rect& b) {
  return {a.x0 > b.x0 ? a.x0 : b.x0, a.y0 > b.y0 ? a.y0 : b.y0, a.x1 < b.x1 ? a.x1 : b.x1, a.y1 < b.y1 ? a.y1 : b.y1};
}

/// Pixels [height][width], row 0 at the top, rows without padding.
template <typename Pixel>
class Image {
 public:
  Image() = default;
  explicit Image(Size size, Pixel fill = {}) : size_(size), pixels_(size.area(), fill) {}

  [[nodiscard]] Size size() const { return size_; }
  [[nodiscard]] int width() const { return size_.width; }
  [[nodiscard]] int height() const { return size_.height; }
  [[nodiscard]] std::span<Pixel> pixels() { return pixels_; }
  [[nodiscard]] std::span<const Pixel> pixels() const { return pixels_; }
  [[nodiscard]] std::span<Pixel> row(int y) { return std::span(pixels_).subspan(index(0, y), width_count()); }
  [[nodiscard]] std::span<const Pixel> row(int y) const {
    return std::span(pixels_).subspan(index(0, y), width_count());
  }
  [[nodiscard]] Pixel& at(int x, int y) { return pixels_[index(x, y)]; }
  [[nodiscard]] const Pixel& at(int x, int y) const { return pixels_[index(x, y)]; }

  bool operator==(const Image&) const = default;

 private:
  [[nodiscard]] std::size_t width_count() const { return static_cast<std::size_t>(size_.width); }
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * width_count() + static_cast<std::size_t>(x);
  }

  Size size_;
  std::vector<Pixel> pixels_;
};

/// A copy of what stands at `rect`, which lies within `image`.
template <typename Pixel>
[[nodiscard]] Image<Pixel> cut(const Image<Pixel>& image, const Rect& rect) {
  Image<Pixel> part({rect.width(), rect.height()});
  for (int y = 0; y < part.height(); ++y) {
    std::ranges::copy_n(image.row(rect.y0 + y).begin() + rect.x0, part.width(), part.row(y).begin());
  }
  return part;
}

/// Copies `part` into `image`, its upper left pixel to (x, y); all of it lies within.
template <typename Pixel>
void paste(const Image<Pixel>& part, int x, int y, Image<Pixel>& image) {
  for (int row = 0; row < part.height(); ++row) std::ranges::copy(part.row(row), image.row(y + row).begin() + x);
}

}  // namespace hpr
