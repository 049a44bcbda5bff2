#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "image/key.h"
#include "image/tiles.h"
#include "rt/passes/pass.h"

namespace hpr {

/// One sample of a tile: where it lies, who looks and what is seen.
struct TileJob {
  Rect place;
  SampleNumber number;
  std::span<const Key> keys;
  const View* view = nullptr;
  std::uint32_t first_pixel = 0;              ///< index into PixelSums: those of other samples come before
  std::span<const std::uint8_t> wanted = {};  ///< 1 at the pixels that are lit; empty: all

  [[nodiscard]] bool wants(std::size_t pixel) const { return wanted.empty() || wanted[pixel] != 0; }
};

/// `tiles` in the order of work in which threads end together: those that see most surfaces first. As they are where
/// there are so many that the last ones hardly matter.
[[nodiscard]] std::vector<std::size_t> fullest_first(std::span<const std::size_t> tiles, const TileLayer<Key>& keys,
                                                     int threads);

/// Rows of a tile, from its own first one.
struct RowRange {
  int first = 0;
  int end = 0;
};

/// Points that are worked on together: enough to fill packets, few enough for the second-level cache.
inline constexpr std::size_t kWavePoints = 512;

/// The ray through (x, y) of the tile, in pixels from its upper left corner, from the near plane to the far one.
/// `view`: the job's, looked through at any place of the pixels.
[[nodiscard]] RayRequest eye_ray(const View& view, const TileJob& job, double x, double y);

/// Past the last of the rows, `first` and on, whose pixels make a wave.
[[nodiscard]] int end_of_wave(const TileJob& job, int first);

/// Sets a point whose surface is set, seen at pixel (x, y) of the tile, of which it covers `share`.
void start_point(const LightContext& context, const TileJob& job, int x, int y, double share, PathPoint& point);

/// The first generation of points in some rows of a tile: the surfaces its keys name, and those of partial coverage
/// before them, each with the share of the pixel it covers. Adds the background where neither is.
void find_first_points(const LightContext& context, const TileJob& job, const RowRange& rows, RayBuffers& buffers,
                       PixelSums& sums, std::vector<PathPoint>& points);

}  // namespace hpr
