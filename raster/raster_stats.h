#pragma once

#include <algorithm>
#include <cstdint>

namespace hpr {

/// Counts and times of the last draw(), or of several.
struct RasterStats {
  std::uint64_t triangles_drawn = 0;  ///< sent to GL, summed over the parts
  std::uint64_t triangles_culled = 0;
  std::uint64_t chunks_drawn = 0;
  std::uint64_t chunks_culled = 0;
  std::uint64_t pixels_read = 0;
  double cull_ms = 0.0;
  double draw_ms = 0.0;  ///< upload of the commands, clear and GL's drawing, to its end
  double read_ms = 0.0;  ///< until its pixels are in memory, joined to keys where a shader does that
  double pack_ms = 0.0;  ///< into the layer's tiles

  RasterStats& operator+=(const RasterStats& other) {
    triangles_drawn += other.triangles_drawn;
    triangles_culled += other.triangles_culled;
    chunks_drawn += other.chunks_drawn;
    chunks_culled += other.chunks_culled;
    pixels_read += other.pixels_read;
    cull_ms += other.cull_ms;
    draw_ms += other.draw_ms;
    read_ms += other.read_ms;
    pack_ms += other.pack_ms;
    return *this;
  }
  /// Adds the counts of another rank, which drew at the same time: the longer times stay.
  void join(const RasterStats& other) {
    const RasterStats own = *this;
    *this += other;
    cull_ms = std::max(own.cull_ms, other.cull_ms);
    draw_ms = std::max(own.draw_ms, other.draw_ms);
    read_ms = std::max(own.read_ms, other.read_ms);
    pack_ms = std::max(own.pack_ms, other.pack_ms);
  }
};

}  // namespace hpr
