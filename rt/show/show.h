#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "image/color.h"

namespace hpr {

/// What a picture shows: light, or something in the place of all shaders. The values of all but light are display
/// values from 0 to 1, without exposure, tone or transfer function.
enum class Show : std::uint8_t {
  Shaded,     ///< light
  Normal,     ///< 0.5 n + 0.5 of the shading normal n: world, on the viewer's side
  Uv,         ///< the fractions of the first texture coordinates as red and green
  Wireframe,  ///< edges of visible triangles, a pixel wide, black on white
  Ids,        ///< distinct_color() of the instance of a mesh
  Rank,       ///< distinct_color() of the rank that drew the surface, or else lit the pixel
  Cost,       ///< count_color() of the rays that the pixel's light takes
  Overdraw,   ///< count_color() of the surfaces along the pixel's ray
  Ao,         ///< the part of the rays about the normal that nothing near stops
};
inline constexpr std::array<std::string_view, 9> kShowNames{"shaded", "normal", "uv",       "wireframe", "ids",
                                                            "rank",   "cost",   "overdraw", "ao"};
[[nodiscard]] constexpr std::string_view name_of(Show show) {
  return kShowNames.at(static_cast<std::size_t>(show));
}

/// Whether the light of pixels is computed for it.
[[nodiscard]] constexpr bool needs_light(Show show) {
  return show == Show::Shaded || show == Show::Cost;
}
/// Whether rays other than those of light are traced for it.
[[nodiscard]] constexpr bool traces_own_rays(Show show) {
  return show == Show::Overdraw || show == Show::Ao;
}

/// A color that few other numbers have, and none of the neighbors: hues a golden section apart.
[[nodiscard]] Rgb distinct_color(std::uint32_t number);

/// From black over red and yellow to white: a third of r + g + b is log2(1 + count) / log2(1 + most), 1 from there on.
[[nodiscard]] Rgb count_color(double count, double most);
inline constexpr double kMaxCost = 4095.0;
inline constexpr double kMaxOverdraw = 255.0;

/// Rays about the normal of a point, for each sample of a pixel.
inline constexpr int kShownOcclusionRays = 16;

}  // namespace hpr
