#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "image/color.h"
#include "image/tiles.h"
#include "rt/lights/light_sampler.h"
#include "rt/ray_settings.h"
#include "rt/sampling/sampler.h"
#include "rt/trace/coverage_traversal.h"
#include "scene/scene.h"
#include "scene/view.h"

namespace hpr {

/// How paths find light. All three have the same mean; the single ones are there to be compared with.
enum class Technique : std::uint8_t {
  Both,     ///< lights and lobes are sampled, and weighed by the power heuristic (Veach 1997, section 9.2)
  Lights,   ///< lights are sampled; what lobes with more than one direction meet by chance is left out
  Surfaces  ///< only lobes are sampled; lights that rays cannot meet are sampled all the same
};

struct PathSettings {
  std::uint64_t seed = 1;
  int max_depth =
      64;  ///< ray segments of the longest path: 1 shows what emits, 2 adds its light on surfaces, and so on
  int roulette_from = 4;  ///< bounces every path is let make; past max_depth: no roulette
  Technique technique = Technique::Both;
  Background background = {};  ///< what paths meet that leave the scene from the eye
  double glossy_cutoff = 0.3;  ///< lobes that the passes follow (photon_query.h) show unlit surfaces, others do not
  /// Lifts the origins of shadow rays off coarse meshes with smooth normals (see SurfacePoint::lift), as the passes do.
  /// It changes the integral: what is compared with others does without.
  bool terminator_fix = false;
  /// Each pixel's sample looks through a place of its own, spread evenly over the pixel (a box filter); false: through
  /// the pixel's centre.
  bool spread_in_pixel = true;
  int threads = 1;
};

/// What tracing took, and what had to be left out.
struct PathCounts {
  std::uint64_t paths = 0;
  std::uint64_t primary = 0;  ///< rays from the eye
  std::uint64_t diffuse = 0;  ///< rays by the lobe that sent them
  std::uint64_t reflection = 0;
  std::uint64_t transmission = 0;
  std::uint64_t shadow = 0;
  std::uint64_t invalid = 0;     ///< rays above that Embree cannot trace (is_traceable): they missed
  std::uint64_t cut = 0;         ///< rays that ended among surfaces of partial coverage, see kMaxPassed
  std::uint64_t too_long = 0;    ///< paths cut at max_depth
  std::uint64_t not_finite = 0;  ///< samples that were no finite number: they are black
  ScreenPixel first_not_finite;  ///< the first such pixel; else kNoPixel

  PathCounts& operator+=(const PathCounts& other);
  bool operator==(const PathCounts&) const = default;
};

/// Layers that the path tracer writes, of one layout.
struct PathOutput {
  TileLayer<Rgb>* radiance = nullptr;
  TileLayer<float>* coverage = nullptr;  ///< fraction of the pixel that surfaces cover; null where not wanted
};

/// The reference: Kajiya's rendering equation by unidirectional path tracing with next-event estimation, multiple
/// importance sampling and Russian roulette (Pharr, Jakob, Humphreys, "Physically Based Rendering", 4th edition,
/// sections 13.2 to 13.4). Shares materials, lights and what rays meet with the passes, and nothing else. Unbiased up
/// to max_depth, but for what no ray can find: point and directional lights seen through glass or by mirrors.
///
/// A sample depends on its number, its pixel and its view only: threads, tile lists and ranks change no bit.
class PathTracer {
 public:
  /// `rays` goes through `scene` in RaySpace(scene). All must outlive this.
  PathTracer(const Scene& scene, const CoverageTraversal& rays, const LightSampler& lights, PathSettings settings,
             RayForwarding* others = nullptr);
  ~PathTracer();
  PathTracer(const PathTracer&) = delete;
  PathTracer& operator=(const PathTracer&) = delete;
  PathTracer(PathTracer&&) noexcept;
  PathTracer& operator=(PathTracer&&) noexcept;

  /// Sets every pixel of `tiles` (screen i of the layers is seen by views[i], of equal size) to the radiance of one
  /// sample, and makes the tiles active; other tiles stay as they are. Where pixels are not `wanted`, which is all of
  /// them when null, they are black. Values are finite and never negative. Memory: below 1 MB a thread, whatever the
  /// depth.
  void trace(std::span<const View> views, std::span<const std::size_t> tiles, const SampleNumber& number,
             const PathOutput& output, const PixelMask* wanted = nullptr);

  /// Counts of the last trace().
  [[nodiscard]] const PathCounts& counts() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace hpr
