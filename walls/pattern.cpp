#include "walls/pattern.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <vector>

#include "walls/canvas.h"
#include "walls/geometry.h"
#include "walls/plan.h"

namespace hpr {
namespace {

constexpr Rgba8 kBlack{0, 0, 0, 255};
constexpr Rgba8 kWhite{255, 255, 255, 255};
constexpr Rgba8 kBackground{24, 26, 32, 255};
constexpr Rgba8 kGrid{84, 88, 98, 255};
constexpr Rgba8 kCircle{255, 210, 0, 255};
constexpr Rgba8 kDiagonal{0, 200, 255, 255};

/// Wall metres in the plane of a screen -> that screen's pixels.
class ScreenPixels {
 public:
  explicit ScreenPixels(const WallScreen& screen) : screen_(screen), axes_(screen_axes(screen)) {}

  [[nodiscard]] glm::dvec2 operator()(const glm::dvec3& p) const {
    const glm::dvec3 inside = p - screen_.upper_left;
    return {glm::dot(inside, axes_[0]) / screen_width(screen_) * screen_.pixels.width,
            -glm::dot(inside, axes_[1]) / screen_height(screen_) * screen_.pixels.height};
  }

 private:
  const WallScreen& screen_;
  glm::dmat3 axes_;
};

/// Circle and diagonals of the whole plane, computed in metres so that they are continuous for the eye.
void draw_shared_lines(Canvas& canvas, const Wall& wall, std::size_t index, double width) {
  std::vector<std::size_t> plane;
  for (auto& screens : wall_planes(wall)) {
    if (std::ranges::find(screens, index) != screens.end()) plane = std::move(screens);
  }
  const WallExtent extent = wall_extent(screens_of(wall, plane));
  const ScreenPixels pixels(wall.screens[index]);
  const auto point = [&](double x, double y) { return pixels(extent.center + extent.axes * glm::dvec3(x, y, 0.0)); };
  const double x = 0.5 * extent.width;
  const double y = 0.5 * extent.height;
  canvas.line(point(-x, -y), point(x, y), kDiagonal, width);
  canvas.line(point(-x, y), point(x, -y), kDiagonal, width);

  // Chords within a thousandth of a pixel of the circle: r (1 - cos(half a step)) <= 0.001.
  const double radius = 0.94 * std::min(x, y);
  const double radius_px = glm::distance(point(0.0, 0.0), point(radius, 0.0));
  const int steps = std::clamp(static_cast<int>(std::ceil(std::numbers::pi * std::sqrt(radius_px / 0.002))), 64, 8192);
  std::vector<glm::dvec2> circle;
  for (int i = 0; i <= steps; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / steps;
    circle.push_back(point(radius * std::cos(angle), radius * std::sin(angle)));
  }
  canvas.polyline(circle, kCircle, width);
}

void draw_ramp(Canvas& canvas, Size size) {
  constexpr int kSteps = 17;
  const double height = std::max(2.0, 0.07 * size.height);
  const double left = 0.1 * size.width;
  const double width = 0.8 * size.width / kSteps;
  const double top = 0.86 * size.height - 0.5 * height;
  for (int i = 0; i < kSteps; ++i) {
    const auto level = static_cast<std::uint8_t>(std::min(255, 16 * i));
    const double x0 = std::round(left + width * i);
    const double x1 = std::round(left + width * (i + 1));
    canvas.fill({x0, std::round(top)}, {x1 - x0, std::round(height)}, {level, level, level, 255});
  }
}

/// Alternating pixels show a display that resamples.
void draw_checkers(Image<Rgba8>& image) {
  constexpr int kSide = 24;
  constexpr int kInset = 6;
  const int w = image.width();
  const int h = image.height();
  if (w < 3 * (kSide + kInset) || h < 3 * (kSide + kInset)) return;
  for (const int x0 : {kInset, w - kInset - kSide}) {
    for (const int y0 : {kInset, h - kInset - kSide}) {
      for (int y = y0; y < y0 + kSide; ++y) {
        for (int x = x0; x < x0 + kSide; ++x) image.at(x, y) = (x + y) % 2 == 0 ? kWhite : kBlack;
      }
    }
  }
}

}  // namespace

Image<Rgba8> wall_pattern(const Wall& wall, std::size_t index) {
  const WallScreen& screen = wall.screens.at(index);
  const Size size = screen.pixels;
  const double w = size.width;
  const double h = size.height;
  PixelCanvas canvas(size);
  canvas.fill({0.0, 0.0}, {w, h}, kBackground);
  constexpr int kGridStep = 64;
  for (int x = kGridStep; x < size.width; x += kGridStep) canvas.fill({x, 0.0}, {1.0, h}, kGrid);
  for (int y = kGridStep; y < size.height; y += kGridStep) canvas.fill({0.0, y}, {w, 1.0}, kGrid);
  draw_ramp(canvas, size);
  const double small = std::min(w, h);
  draw_shared_lines(canvas, wall, index, std::max(1.5, small / 180.0));
  canvas.frame({0.0, 0.0}, {w, h}, kWhite, 1.0);

  // An id as large as fits, and what it stands for.
  const double letters = static_cast<double>(std::max<std::size_t>(screen.id.size(), 4));
  const double height = std::min(0.22 * h, 0.8 * w / (0.62 * letters));
  canvas.text({0.5 * w, 0.42 * h}, screen.id, height, kWhite);
  const std::string facts = fmt::format("{} x {} px, {}", size.width, size.height, owner_of(wall, screen));
  const double facts_height = std::min(0.06 * h, 0.8 * w / (0.62 * static_cast<double>(facts.size())));
  canvas.text({0.5 * w, 0.42 * h + 0.75 * height}, facts, facts_height, kWhite);
  const double arrow = 0.08 * small;
  const glm::dvec2 tip(0.5 * w, 0.06 * h);
  canvas.polyline(std::array{tip + glm::dvec2(-0.5 * arrow, arrow), tip, tip + glm::dvec2(0.5 * arrow, arrow)}, kWhite,
                  std::max(1.5, small / 120.0));

  Image<Rgba8> image = canvas.image();
  draw_checkers(image);
  return image;
}

}  // namespace hpr
