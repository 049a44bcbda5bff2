#include "walls/drawing/pattern.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <vector>

#include "image/image.h"
#include "walls/drawing/canvas.h"
#include "walls/drawing/plan.h"
#include "walls/geometry/geometry.h"
#include "walls/geometry/neighbors.h"

namespace hpr {
namespace {

constexpr Rgba8 kBlack{0, 0, 0, 255};
constexpr Rgba8 kWhite{255, 255, 255, 255};
constexpr Rgba8 kBackground{24, 26, 32, 255};
constexpr Rgba8 kGrid{84, 88, 98, 255};
constexpr Rgba8 kCircle{255, 210, 0, 255};
constexpr Rgba8 kDiagonal{0, 200, 255, 255};
constexpr Rgba8 kNeighbor{150, 255, 150, 255};

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

/// Millimetres from one tick to the next: few enough that they do not run together.
double tick_mm(double pixels_per_mm) {
  constexpr double kClosest = 5.0;
  for (const double step : {1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0}) {
    if (step * pixels_per_mm >= kClosest) return step;
  }
  return 1000.0;
}

constexpr int kLong = 10;

/// One tick of a ruler at the top edge (`across`) or the left one; `at`: pixels from its beginning.
void draw_tick(Canvas& canvas, bool across, double at, int number, double unit, double step) {
  const double length = number % kLong == 0 ? 3.0 * unit : number % (kLong / 2) == 0 ? 2.0 * unit : unit;
  across ? canvas.fill({at, 0.0}, {1.0, std::round(length)}, kWhite)
         : canvas.fill({0.0, at}, {std::round(length), 1.0}, kWhite);
  if (number % kLong != 0) return;
  const std::string text = fmt::format("{:g}", number * step);
  const double height = std::max(5.0, 1.6 * unit);
  canvas.text(across ? glm::dvec2(at, 3.0 * unit + 0.7 * height)
                     : glm::dvec2(3.0 * unit + 0.4 * height * static_cast<double>(text.size()), at),
              text, height, kWhite);
}

/// Along the top edge from the left and the left edge from the top; every tenth tick is long and numbered.
void draw_rulers(Canvas& canvas, const WallScreen& screen) {
  const glm::dvec2 size(screen.pixels.width, screen.pixels.height);
  const double meters = screen_width(screen);
  const double pixels_per_mm = size.x / (1000.0 * meters);
  const double step = tick_mm(pixels_per_mm);
  const double unit = std::min(size.x, size.y) / 100.0;
  if (unit < 1.0) return;
  for (const bool across : {true, false}) {
    const double length_mm = 1000.0 * (across ? meters : screen_height(screen));
    for (int i = 1; i * step < length_mm; ++i) {
      draw_tick(canvas, across, std::round(i * step * (across ? pixels_per_mm : size.y / length_mm)), i, unit, step);
    }
  }
}

/// Where the picture goes on, and as which screen.
void draw_neighbors(Canvas& canvas, const Wall& wall, std::size_t index) {
  const glm::dvec2 size(wall.screens[index].pixels.width, wall.screens[index].pixels.height);
  const double arrow = 0.035 * std::min(size.x, size.y);
  const double height = 0.9 * arrow;
  if (height < 4.0) return;
  const auto neighbors = adjacent_screens(wall, index);
  const auto label = [&](Side side) -> std::string {
    const auto found = neighbors.at(static_cast<std::size_t>(side));
    return found ? wall.screens[*found].id : "";
  };
  const auto draw = [&](Side side, glm::dvec2 tip, glm::dvec2 back, bool upright) {
    const std::string id = label(side);
    if (id.empty()) return;
    const glm::dvec2 across(back.y, -back.x);
    canvas.polyline(std::array{tip + arrow * (back + 0.6 * across), tip, tip + arrow * (back - 0.6 * across)},
                    kNeighbor, std::max(1.5, arrow / 6.0));
    // Beside the arrow in either case: what is above and below has other things to show.
    const double half_text = 0.3 * height * static_cast<double>(id.size());
    canvas.text(upright ? tip + 0.5 * arrow * back + glm::dvec2(arrow + half_text, 0.0)
                        : tip + (1.5 * arrow + half_text) * back,
                id, height, kNeighbor);
  };
  draw(Side::Left, {0.01 * size.x, 0.28 * size.y}, {1.0, 0.0}, false);
  draw(Side::Right, {0.99 * size.x, 0.28 * size.y}, {-1.0, 0.0}, false);
  draw(Side::Up, {0.72 * size.x, 0.08 * size.y}, {0.0, 1.0}, true);
  draw(Side::Down, {0.72 * size.x, 0.97 * size.y}, {0.0, -1.0}, true);
}

/// "wall05, rank 3 at :0.1 DP-2": who drives it, and at which output.
std::string driver_of(const Wall& wall, const WallScreen& screen) {
  std::string text = owner_of(wall, screen);
  const auto window = std::ranges::find(wall.windows, screen.window, &WallWindow::id);
  if (screen.window.empty() || window == wall.windows.end()) return text;
  std::string output = window->display;
  if (!window->monitor.empty()) output += (output.empty() ? "" : " ") + window->monitor;
  if (window->monitor.empty() && !window->rect.empty()) {
    output += fmt::format(" +{}+{}", window->rect.x0 + screen.viewport.x0, window->rect.y0 + screen.viewport.y0);
  }
  return output.empty() ? text : fmt::format("{} at {}", text, output);
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

  draw_rulers(canvas, screen);
  draw_neighbors(canvas, wall, index);

  // An id as large as fits, and what it stands for.
  const double letters = static_cast<double>(std::max<std::size_t>(screen.id.size(), 4));
  const double height = std::min(0.22 * h, 0.8 * w / (0.62 * letters));
  canvas.text({0.5 * w, 0.42 * h}, screen.id, height, kWhite);
  const std::string facts = fmt::format("{} x {} px, {}", size.width, size.height, driver_of(wall, screen));
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
