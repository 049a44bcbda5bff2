#pragma once

#include <cstddef>
#include <mutex>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "rt/denoise/coverage_fragments.h"
#include "rt/denoise/denoiser.h"
#include "rt/passes/half_resolution.h"
#include "rt/passes/pass.h"
#include "rt/passes/pixel_sums.h"
#include "rt/passes/tile_margin.h"
#include "rt/ray_counts.h"
#include "rt/scratch_pool.h"

namespace hpr {

/// The memory one thread needs for wavefronts of a tile, and what it did.
struct WaveScratch {
  explicit WaveScratch(std::size_t steps) : ms(steps, 0.0) {}

  RayBuffers buffers;
  std::vector<std::vector<PathVertex>> waiting = std::vector<std::vector<PathVertex>>(1);  ///< by depth
  Wavefront wave;
  std::vector<double> ms;  ///< spent on each step

  [[nodiscard]] double spent_ms() const { return std::accumulate(ms.begin(), ms.end(), 0.0); }
  /// Hands over what it counted.
  void gather(RayCounts& counts, std::vector<double>& times) {
    counts += std::exchange(buffers.counts, {});
    counts.cut += std::exchange(buffers.scratch.cut, 0);
    for (std::size_t i = 0; i < ms.size(); ++i) times[i] += std::exchange(ms[i], 0.0);
  }
};

/// While rays are forwarded, more threads run than there are cores, and most of them wait: scales the times of the
/// steps to the time that was spent.
inline void share_out(double spent, std::vector<double>& ms) {
  const double sum = std::accumulate(ms.begin(), ms.end(), 0.0);
  for (double& step : ms) step *= sum > 0.0 ? spent / sum : 0.0;
}

/// The memory one thread needs for a tile.
struct TileScratch {
  explicit TileScratch(std::size_t steps) : own(steps) {}

  PixelSums sums;
  HalfResShading shared;
  Denoiser denoiser;
  FragmentFinder finder;
  std::vector<TileMargin> margins;                          ///< per sample, where filters read any
  std::vector<PathVertex> points;                           ///< that a filter adds
  std::vector<std::vector<PathVertex>> margin_points = {};  ///< that are shaded beside rows of the tile; per sample
  WaveScratch own;
  std::mutex mutex;         ///< of the filters and helpers_ms, where rows are shaded side by side
  double helpers_ms = 0.0;  ///< processor time of the threads that shaded some of its rows beside its own
};

/// The strips of a sample, if its filters read any.
[[nodiscard]] inline std::span<const TileJob> margin_of(const TileScratch& scratch, std::size_t sample) {
  return scratch.margins.empty() ? std::span<const TileJob>() : scratch.margins[sample].strips();
}

}  // namespace hpr
