#include "tools/diff/diff_colors.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "image/color.h"
#include "image/flip.h"
#include "image/metrics.h"

namespace hpr {
namespace {

std::size_t not_finite_pixels(std::span<const float> a, std::span<const float> b) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < a.size(); i += 3) {
    if (!all_finite(a.subspan(i, 3)) || !all_finite(b.subspan(i, 3))) ++count;
  }
  return count;
}

}  // namespace

std::optional<std::array<std::size_t, 3>> color_places(const FloatImage& picture) {
  const auto place = [&](const char* channel) {
    return static_cast<std::size_t>(std::ranges::find(picture.channels, channel) - picture.channels.begin());
  };
  const std::size_t none = picture.channels.size();
  std::array<std::size_t, 3> places{place("R"), place("G"), place("B")};
  if (std::ranges::count(places, none) != 0) places.fill(place("Y"));
  if (places[0] == none) return std::nullopt;
  return places;
}

std::vector<float> colors_of(const FloatImage& picture) {
  const auto places = color_places(picture);
  if (!places) return {};
  std::vector<float> colors;
  colors.reserve(picture.size.area() * places->size());
  for (std::size_t pixel = 0; pixel < picture.size.area(); ++pixel) {
    for (const std::size_t place : *places) colors.push_back(picture.values[pixel * picture.channels.size() + place]);
  }
  return colors;
}

bool asks_for(std::span<const std::string> metrics, std::string_view metric) {
  return std::ranges::find(metrics, metric) != metrics.end();
}

bool asks_for_colors(std::span<const std::string> metrics) {
  return asks_for(metrics, "relmse") || asks_for(metrics, "ssim") || asks_for(metrics, "flip");
}

std::optional<ColorErrors> compare_colors(const FloatImage& a, const FloatImage& b,
                                          std::span<const std::string> metrics, int threads) {
  std::vector<float> reference = colors_of(a);
  std::vector<float> image = colors_of(b);
  if (reference.empty() && a.size.area() > 0) return std::nullopt;
  ColorErrors errors;
  errors.not_finite = not_finite_pixels(reference, image);
  if (errors.not_finite > 0) return errors;
  if (asks_for(metrics, "relmse")) errors.relative = relative_error(image, reference, 3);
  if (a.linear) {
    for (std::vector<float>* const values : {&reference, &image})
      std::ranges::transform(*values, values->begin(), encode_srgb);
  }
  if (asks_for(metrics, "ssim")) errors.ssim = ssim(image, reference, a.size, threads);
  if (asks_for(metrics, "flip")) errors.flip = flip_error(image, reference, a.size, threads).mean;
  return errors;
}

}  // namespace hpr
