#include "walls/drawing/panel_transform.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/error.h"
#include "image/filter.h"
#include "image/image.h"
#include "walls/drawing/assemble.h"
#include "walls/geometry/geometry.h"
#include "walls/geometry/neighbors.h"
#include "walls/geometry/warping.h"

namespace hpr {
namespace {

/// Widths in metres: left, right, bottom, top.
using Fades = std::array<double, 4>;

/// More than measuring noise: screens that only touch do not overlap.
bool overlaps(const PlanarBox& box, const WallScreen& screen) {
  return overlap_meters(box, screen) > 1e-6 * (screen_width(screen) + screen_height(screen));
}

/// Widens `fades` to how far `other` reaches over each side of `screen`.
void reach_over(const WallScreen& screen, const WallScreen& other, Fades& fades) {
  const auto box = seen_from(other, screen);
  if (!box || !overlaps(*box, screen)) return;
  const std::array<double, 2> size{screen_width(screen), screen_height(screen)};
  const double least = 1e-6 * (size[0] + size[1]);
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const bool over_low = box->low[axis] < least;
    const bool over_high = box->high[axis] > size[axis] - least;
    if (over_low == over_high) continue;  // over both: it lies beside, along the other axis
    double& side = fades[2 * axis + (over_low ? 0 : 1)];
    side = std::max(side, over_low ? box->high[axis] : size[axis] - box->low[axis]);
  }
}

Fades fades_of(const Wall& wall, const WallScreen& screen) {
  const EdgeBlend& blend = screen.blend;
  Fades fades{blend.left, blend.right, blend.bottom, blend.top};
  if (!blend.automatic) return fades;
  for (const auto* screens : {&wall.screens, &wall.elsewhere}) {
    for (const WallScreen& other : *screens) {
      if (&other != &screen && other.blend.any()) reach_over(screen, other, fades);
    }
  }
  return fades;
}

/// A ramp that rises from 0 at the edge to 1 at `width` from it.
double rise(double distance, double width, double gamma) {
  if (width <= 0.0) return 1.0;
  const double t = std::clamp(distance / width, 0.0, 1.0);
  return t < 0.5 ? 0.5 * std::pow(2.0 * t, gamma) : 1.0 - 0.5 * std::pow(2.0 - 2.0 * t, gamma);
}

/// The level of an sRGB signal in [0, 1] after the panel's own curve.
double corrected(const PanelColor& color, int channel, double level) {
  return color.gamma[channel] == 1.0 ? level : std::pow(level, 1.0 / color.gamma[channel]);
}

/// Linear light the panel shows.
double shown_light(const PanelColor& color, int channel, double light, double weight, double floor) {
  const double black = color.black[channel] + (1.0 - color.black[channel]) * floor;
  return black + (1.0 - black) * std::clamp(color.gain[channel] * weight * light, 0.0, 1.0);
}

float value_of(const Rgb& color, int channel) {
  return channel == 0 ? color.r : channel == 1 ? color.g : color.b;
}

std::uint8_t& value_of(Rgba8& color, int channel) {
  return channel == 0 ? color.r : channel == 1 ? color.g : color.b;
}

/// A position in a picture as one of the larger picture of which it is a part, at (x, y).
SourcePosition moved(const SourcePosition& source, int x, int y) {
  return {source.x + (static_cast<std::uint32_t>(x) << 16U), source.y + (static_cast<std::uint32_t>(y) << 16U)};
}

/// Writes the positions of a part into those of the whole picture, at `rect`.
void put(const Image<SourcePosition>& part, const Rect& rect, Image<SourcePosition>& whole) {
  for (int y = 0; y < part.height(); ++y) {
    std::ranges::transform(part.row(y), whole.row(rect.y0 + y).begin() + rect.x0, [&](const SourcePosition& source) {
      return source == kNoSource ? kNoSource : moved(source, rect.x0, rect.y0);
    });
  }
}

/// Per pixel of a part of the screen what it shows of that part, through a mesh or its own.
Image<SourcePosition> sources_in(const ScreenWarp& warp, const Rect& rect) {
  const Size size{rect.width(), rect.height()};
  if (warp.grid) return mesh_sources(*warp.grid, size);
  Image<SourcePosition> sources(size, kNoSource);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const bool lit = warp.points->at((x + 0.5) / size.width, (y + 0.5) / size.height).has_value();
      if (lit) sources.at(x, y) = source_position(x + 0.5, y + 0.5, size);
    }
  }
  return sources;
}

/// `map`, which holds for each of a screen's pictures, on the pixels of the screen.
Image<Rgb> on_screen(const Image<Rgb>& map, const Wall& wall, std::size_t screen) {
  Image<Rgb> result(wall.screens[screen].pixels);
  for (const Rect& rect : eye_rects(wall, screen)) {
    paste(enlarge(map, {rect.width(), rect.height()}, 1), rect.x0, rect.y0, result);
  }
  return result;
}

}  // namespace

BlendWeights::BlendWeights(const Wall& wall, std::size_t screen) {
  HPR_CHECK(screen < wall.screens.size());
  const WallScreen& mine = wall.screens[screen];
  width_ = screen_width(mine);
  height_ = screen_height(mine);
  pixels_ = mine.pixels;
  if (!mine.blend.any()) return;
  add(wall, mine, {{0.0, 0.0}, {width_, height_}, false, {1, 1}});
  for (const auto* screens : {&wall.screens, &wall.elsewhere}) {
    for (const WallScreen& other : *screens) {
      if (&other == &mine || !other.blend.any()) continue;
      const auto box = seen_from(other, mine);
      if (box && overlaps(*box, mine)) add(wall, other, *box);
    }
  }
}

void BlendWeights::add(const Wall& wall, const WallScreen& screen, const PlanarBox& box) {
  const Fades fades = fades_of(wall, screen);
  Area area{box.low, box.high, {}, {}, screen.blend.gamma};
  for (std::size_t axis = 0; axis < 2; ++axis) {  // of that screen
    const std::size_t here = box.swapped ? 1 - axis : axis;
    const bool with = box.along[axis] > 0;
    area.fade_low[here] = fades[2 * axis + (with ? 0 : 1)];
    area.fade_high[here] = fades[2 * axis + (with ? 1 : 0)];
  }
  is_identity_ = is_identity_ && std::ranges::max(fades) <= 0.0;
  areas_.push_back(area);
}

double BlendWeights::ramp(const Area& area, double u, double v) {
  const std::array<double, 2> at{u, v};
  double product = 1.0;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    product *= rise(at[axis] - area.low[axis], area.fade_low[axis], area.gamma) *
               rise(area.high[axis] - at[axis], area.fade_high[axis], area.gamma);
  }
  return product;
}

double BlendWeights::at(double x, double y) const {
  if (is_identity_) return 1.0;
  const double u = x / pixels_.width * width_;
  const double v = (1.0 - y / pixels_.height) * height_;
  const double own = ramp(areas_.front(), u, v);
  if (areas_.size() == 1) return own;
  double sum = 0.0;
  int covering = 0;
  for (const Area& area : areas_) {
    const bool covers = u >= area.low[0] && u <= area.high[0] && v >= area.low[1] && v <= area.high[1];
    if (!covers) continue;
    sum += ramp(area, u, v);
    ++covering;
  }
  return sum > 0.0 ? own / sum : 1.0 / std::max(covering, 1);
}

double panel_level(const PanelColor& color, int channel, double light, double weight, double floor) {
  const double shown = shown_light(color, channel, light, weight, floor);
  return corrected(color, channel, static_cast<double>(encode_srgb(static_cast<float>(shown))));
}

Image<Rgba8> flip(const Image<Rgba8>& image, Mirror mirror) {
  Image<Rgba8> result = image;
  for (int y = 0; y < image.height(); ++y) {
    if (mirror == Mirror::Vertical) std::ranges::copy(image.row(image.height() - 1 - y), result.row(y).begin());
    if (mirror == Mirror::Horizontal) std::ranges::reverse(result.row(y));
  }
  return result;
}

PanelTransform::PanelTransform(const Wall& wall, std::size_t screen)
    : color_(wall.screens.at(screen).color),
      rotate_(wall.screens[screen].rotate),
      mirror_(wall.screens[screen].mirror),
      parts_(eye_rects(wall, screen)) {
  read_blend(wall, screen);
  read_warp(wall, screen);
  shades_ =
      color_ != PanelColor{} || weights_.size().area() > 0 || floors_.size().area() > 0 || dark_.size().area() > 0;
  for (int channel = 0; shades_ && channel < 3; ++channel) {
    to_level_.emplace_back(
        [&](float shown) { return corrected(color_, channel, static_cast<double>(encode_srgb(shown))); });
  }
}

void PanelTransform::read_blend(const Wall& wall, std::size_t screen) {
  const ScreenWarp& warp = wall.screens[screen].warp;
  if (warp.light) weights_ = on_screen(*warp.light, wall, screen);
  const BlendWeights edges(wall, screen);
  if (edges.is_identity()) return;
  if (!warp.light) weights_ = Image<Rgb>(wall.screens[screen].pixels, {1.0F, 1.0F, 1.0F});
  for (const Rect& rect : eye_rects(wall, screen)) {
    // Each of two pictures fills the panel once it is shown.
    const double wider = static_cast<double>(weights_.width()) / rect.width();
    const double higher = static_cast<double>(weights_.height()) / rect.height();
    for (int y = rect.y0; y < rect.y1; ++y) {
      for (int x = rect.x0; x < rect.x1; ++x) {
        const auto weight = static_cast<float>(edges.at((x - rect.x0 + 0.5) * wider, (y - rect.y0 + 0.5) * higher));
        Rgb& pixel = weights_.at(x, y);
        pixel = {pixel.r * weight, pixel.g * weight, pixel.b * weight};
      }
    }
  }
}

void PanelTransform::read_warp(const Wall& wall, std::size_t screen) {
  const ScreenWarp& warp = wall.screens[screen].warp;
  const Size size = wall.screens[screen].pixels;
  if (warp.floor) floors_ = on_screen(*warp.floor, wall, screen);
  if (!warp.grid && !warp.points) return;
  Image<SourcePosition> sources(size);
  for (const Rect& rect : eye_rects(wall, screen)) put(sources_in(warp, rect), rect, sources);
  if (std::ranges::find(sources.pixels(), kNoSource) != sources.pixels().end()) {
    dark_ = Image<std::uint8_t>(size);
    std::ranges::transform(sources.pixels(), dark_.pixels().begin(),
                           [](const SourcePosition& source) { return static_cast<std::uint8_t>(source == kNoSource); });
  }
  if (warp.grid) sources_ = std::move(sources);
}

Image<Rgba8> PanelTransform::apply(const Image<Rgba8>& picture) const {
  Image<Rgba8> sent = sources_.size().area() > 0 ? warped(picture, sources_, 1) : picture;
  for (int channel = 0; shades_ && channel < 3; ++channel) shade(sent, channel);
  if (parts_.size() < 2) return mounted(std::move(sent));
  // Each eye's picture is turned in its place: left stays left.
  Image<Rgba8> joined = sent;
  for (const Rect& rect : parts_) {
    paste(mounted(cut(sent, rect)), rect.x0, rect.y0, joined);
  }
  return joined;
}

Image<Rgba8> PanelTransform::mounted(Image<Rgba8> picture) const {
  if (rotate_ != 0) picture = turn_clockwise(picture, rotate_);
  if (mirror_ != Mirror::None) picture = flip(picture, mirror_);
  return picture;
}

void PanelTransform::shade(Image<Rgba8>& picture, int channel) const {
  const LevelTable& to_level = to_level_[static_cast<std::size_t>(channel)];
  const auto level = [&](std::uint8_t value, float weight, float floor) {
    return to_level(static_cast<float>(shown_light(color_, channel, static_cast<double>(srgb_to_linear(value)),
                                                   static_cast<double>(weight), static_cast<double>(floor))));
  };
  std::array<std::uint8_t, 256> whole{};  // where nothing is faded or lifted
  for (std::size_t i = 0; i < whole.size(); ++i) whole[i] = level(static_cast<std::uint8_t>(i), 1.0F, 0.0F);
  const auto weights = weights_.pixels();
  const auto floors = floors_.pixels();
  const auto dark = dark_.pixels();
  const auto pixels = picture.pixels();
  HPR_CHECK(weights.empty() || weights.size() == pixels.size());
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const float weight = weights.empty() ? 1.0F : value_of(weights[i], channel);
    const float floor = floors.empty() ? 0.0F : value_of(floors[i], channel);
    std::uint8_t& value = value_of(pixels[i], channel);
    value = weight >= 1.0F && floor <= 0.0F ? whole[value] : level(value, weight, floor);
    if (!dark.empty() && dark[i] != 0) value = 0;
  }
}

}  // namespace hpr
