#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "rt/passes/pass_id.h"
#include "rt/sampling/sampler.h"
#include "scene/view.h"

namespace hpr {

/// What was spent on a tile, or on some of it.
struct TileCost {
  std::size_t tile = 0;
  double ms = 0.0;  ///< of one processor
};

/// What the last PrimaryRays::draw() counted.
struct PrimaryRayStats {
  std::uint64_t rays = 0;      ///< none go through pixels where no box about triangles is seen
  std::uint64_t invalid = 0;   ///< rays that Embree cannot trace (is_traceable): they missed
  std::uint64_t weighed = 0;   ///< depths computed in double because two candidates, or the near plane, were close
  std::uint64_t retraced = 0;  ///< rays traced again through everything, as their first candidate was no hit

  PrimaryRayStats& operator+=(const PrimaryRayStats& other) {
    rays += other.rays;
    invalid += other.invalid;
    weighed += other.weighed;
    retraced += other.retraced;
    return *this;
  }
};

/// Pixel (x, y) of a view as its screen has it, whether that is joined to others or not; nothing where it is one of
/// those others' pixels.
[[nodiscard]] inline std::optional<ScreenPixel> own_pixel(const View& view, int x, int y) {
  x += view.block.x0;
  y += view.block.y0;
  if (!view.joined_part) return ScreenPixel{view.screen_number, y, x};
  const Rect& own = view.joined_part->pixels;
  if (x < own.x0 || x >= own.x1 || y < own.y0 || y >= own.y1) return std::nullopt;
  return ScreenPixel{view.joined_part->screen_number, y - own.y0, x - own.x0};
}

/// Rays traced, by kind, and what had to be left out.
struct RayCounts {
  std::uint64_t primary = 0;                    ///< from the eye: no pass counts them
  std::array<std::uint64_t, kPasses> passes{};  ///< by PassId
  std::uint64_t invalid = 0;                    ///< rays above that Embree cannot trace (is_traceable): they missed
  std::uint64_t cut = 0;                        ///< rays that ended among surfaces of partial coverage, see kMaxPassed
  std::uint64_t not_finite = 0;                 ///< pixels whose radiance was no finite number: they are black
  ScreenPixel first_not_finite;  ///< the first such pixel by screen and row (own_pixel), on any thread; else kNoPixel

  [[nodiscard]] std::uint64_t& operator[](PassId pass) { return passes.at(static_cast<std::size_t>(pass)); }
  [[nodiscard]] std::uint64_t operator[](PassId pass) const { return passes.at(static_cast<std::size_t>(pass)); }

  RayCounts& operator+=(const RayCounts& other) {
    primary += other.primary;
    for (std::size_t i = 0; i < kPasses; ++i) passes[i] += other.passes[i];
    invalid += other.invalid;
    cut += other.cut;
    not_finite += other.not_finite;
    first_not_finite = std::min(first_not_finite, other.first_not_finite);
    return *this;
  }
  bool operator==(const RayCounts&) const = default;
};

struct PassTime {
  std::string name;                 ///< a pass, or another step: "surface" and "direct" always run
  double ms = 0.0;                  ///< summed over threads
  std::optional<PassId> pass = {};  ///< none: another step
};

}  // namespace hpr
