#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <glm/vec2.hpp>
#include <span>
#include <vector>

#include "image/key.h"
#include "image/tiles.h"
#include "rt/passes/pass.h"

namespace hpr {

/// Rows of a tile, from its own first one.
struct RowRange {
  int first = 0;
  int end = 0;
};

/// One sample of a tile, or of some of its rows: its pixels, its view and its keys.
struct TileJob {
  Rect rect;
  SampleNumber number;
  std::span<const Key> keys;
  const View* view = nullptr;
  std::uint32_t first_pixel = 0;              ///< index into PixelSums: those of other samples come before
  std::span<const std::uint8_t> wanted = {};  ///< 1 at the pixels that are shaded; empty: all
  RowRange rows = {0, kTileSide};             ///< that are shaded, of those there are

  [[nodiscard]] bool wants(std::size_t pixel) const { return wanted.empty() || wanted[pixel] != 0; }
  [[nodiscard]] int end_row() const { return std::min(rows.end, rect.height()); }
  /// Its upper left pixel, of the whole screen.
  [[nodiscard]] glm::ivec2 origin() const { return {view->block.x0 + rect.x0, view->block.y0 + rect.y0}; }
};

/// Orders `tiles` so that threads end at about the same time: those that show most surfaces first. Leaves them as they
/// are where there are so many that the last ones hardly matter.
[[nodiscard]] std::vector<std::size_t> fullest_first(std::span<const std::size_t> tiles, const TileLayer<Key>& keys,
                                                     int threads);

/// Vertices that are shaded together: enough to fill packets, few enough for the second-level cache.
inline constexpr std::size_t kWavefrontVertices = 512;

/// The ray through (x, y) of the tile, in pixels from its upper left corner, from the near plane to the far one.
/// `view`: the job's, at any jitter.
[[nodiscard]] RayRequest eye_ray(const View& view, const TileJob& job, double x, double y);

/// Past the last of the rows, `first` and on, whose pixels make a wavefront: before an even row of the screen, where
/// all pixels are shaded.
[[nodiscard]] int end_of_wavefront(const TileJob& job, int first);

/// The last of some points, a wavefront of whole pixels, whose points are beside each other.
[[nodiscard]] std::span<PathVertex> last_wavefront(std::span<PathVertex> points);

/// Initializes a vertex whose surface is set, shown at pixel (x, y) of the tile, of which it covers `coverage`.
void start_vertex(const LightContext& context, const TileJob& job, int x, int y, double coverage, PathVertex& point);

/// Gets the triangles that all pixels of some tiles show, where other ranks hold them: at once, as each request is a
/// round of messages.
void fetch_triangles(const LightContext& context, std::span<const TileJob> jobs);

/// Finds the primary vertices in some rows of a tile: the surfaces its keys name, and those of partial coverage before
/// them, each with the share of the pixel it covers. Adds the background where neither is.
void find_primary_vertices(const LightContext& context, const TileJob& job, const RowRange& rows, RayBuffers& buffers,
                           PixelSums& sums, std::vector<PathVertex>& points);

/// Below it a path changes an 8-bit sRGB picture of scenes whose radiance is below 10 by less than half of its darkest
/// step, 1 / (2 * 255 * 12.92): by roulette it ends there, or counts for those that did.
inline constexpr double kMinThroughput = 1.0 / 65536.0;

[[nodiscard]] inline double brightness(const glm::dvec3& color) {
  return std::max({color.r, color.g, color.b});
}

/// Russian roulette below kMinThroughput: the factor of a path whose throughput is so bright; 0 where it ends.
[[nodiscard]] inline double russian_roulette_weight(double brightness, Sampler& sampler) {
  if (!(brightness < kMinThroughput)) return 1.0;
  const double chance = brightness / kMinThroughput;
  return chance > 0.0 && sampler.one() < chance ? 1.0 / chance : 0.0;
}

/// Metres within which something that stops a ray counts as near, for ambient occlusion: a quarter of the scene's
/// radius.
[[nodiscard]] double occlusion_reach(const Scene& scene);

/// The component that light from a followed lobe of `point` counts in.
[[nodiscard]] Component component_after(const PathVertex& point, Component first);

/// Completes a vertex whose surface, throughput, sampler, depth and media are set: reads its material, takes off what
/// the last `metres` of the way there absorbed (0: all is taken off already) and decides which lobes are followed.
void finish_vertex(const LightContext& context, PathVertex& point, double metres = 0.0);

/// The rays that follow lobes of a wavefront, of all passes that do. They are traced together: one wait where they
/// travel to other ranks. A pass that gathers all lobes traces rays where no other pass follows the lobe for itself:
/// the sky that such rays find from the first surface counts as direct light, and what hides it as shadow.
class LobeRays {
 public:
  /// `buffers` has the rays; their earlier ones are gone. All must outlive this.
  LobeRays(const LightContext& context, const Wavefront& wave, RayBuffers& buffers, PixelSums& sums);

  /// Makes the rays of a pass: one per vertex and lobe, or one per channel.
  void add(const PassInfo& pass, std::span<const Lobe> lobes);
  /// Traces all rays.
  void trace();
  /// Which fraction of all rays those of pass `i` are, in the order of add().
  [[nodiscard]] double fraction(std::size_t i) const;
  /// Adds what the rays of the next pass found, in that order, and appends the vertices that they reached to `next`.
  void finish(const PassInfo& pass, std::vector<PathVertex>& next);

 private:
  [[nodiscard]] std::size_t first_of(std::size_t i) const { return i == 0 ? 0 : ends_[i - 1]; }
  void add_rays(const PassInfo& pass, Lobe lobe, const PathVertex& point);
  void add_ray(const PassInfo& pass, Lobe lobe, const PathVertex& point, const Bsdf& bsdf);

  const LightContext& context_;
  const Wavefront& wave_;
  RayBuffers& buffers_;
  PixelSums& sums_;
  std::vector<std::size_t> ends_ = {};  ///< of each pass's rays
  std::size_t finished_ = 0;            ///< passes
};

}  // namespace hpr
