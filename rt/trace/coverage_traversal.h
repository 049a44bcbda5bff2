#pragma once

#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "rt/sampling/sampler.h"
#include "rt/trace/ray_scene.h"
#include "rt/trace/surfaces.h"
#include "scene/scene.h"

namespace hpr {

/// Surfaces of partial coverage that light is followed through in a row, by the passes and by the reference. Past
/// them eyes see what covers wholly, and photons end.
inline constexpr int kMaxPassed = 1000;

/// Counts a surface that a ray has passed, and came `gained` metres farther by it; false when it is one too many. What
/// covers nothing does not count, unless nothing was gained: then the ray is caught between coincident surfaces.
[[nodiscard]] inline bool passes_on(int& passed, double coverage, double gained) {
  if (!(coverage > 0.0) && gained > 0.0) return true;
  return ++passed <= kMaxPassed;
}

/// A ray to trace, in world coordinates.
struct RayRequest {
  glm::dvec3 origin{0.0};      ///< off the surface it leaves
  glm::dvec3 direction{0.0};   ///< unit length
  double reach = 0.0;          ///< metres; infinite: as far as it goes
  Sampler* sampler = nullptr;  ///< decides whether it passes surfaces of partial coverage
  std::uint32_t owner = 0;     ///< whatever the caller needs to know it again
  Faces faces = Faces::Both;   ///< that it meets
};

/// A surface of partial coverage that a ray meets.
struct CoveringLayer {
  SurfacePlane plane;
  SurfacePoint point;
  double coverage = 0.0;
};

/// Memory of one thread, kept from call to call.
struct TraversalScratch {
  RayBatch batch;  ///< whose purpose the caller sets
  std::vector<std::uint32_t> surfaces;
  std::vector<std::uint8_t> blocked;
  std::vector<std::uint32_t> waiting;
  std::vector<RayRequest> rest;
  std::vector<int> passed;                         ///< per ray, see passes_on
  std::vector<Passed> last;                        ///< per ray: what it passed
  std::vector<Passed> met;                         ///< per waiting ray
  std::vector<SurfacePlane> ends;                  ///< per ray
  std::vector<std::vector<CoveringLayer>> layers;  ///< per ray: of one plane, met and not yet visited
  std::uint64_t cut = 0;  ///< rays that ended among too many surfaces; who reads it sets it back
};

/// Rays through a scene some of whose surfaces cover only part of what is behind them (alpha MASK and BLEND): such a
/// surface is met with the probability that it covers, and shadow rays lose the share it covers.
class CoverageTraversal {
 public:
  /// All must outlive this. `alpha_tested` holds the surfaces of partial coverage, null where there are none; `opaque`
  /// the others.
  CoverageTraversal(const Scene& scene, const Surfaces& surfaces, const RaySpace& space, const RayScene& opaque,
                    const RayScene* alpha_tested)
      : scene_(scene), surfaces_(surfaces), space_(space), opaque_(opaque), alpha_tested_(alpha_tested) {}

  /// hits[i] is the surface ray i meets first; kNoSurface where it leaves the scene. Returns how many rays were
  /// invalid.
  std::uint64_t closest(std::span<const RayRequest> rays, std::span<std::uint32_t> hits, TraversalScratch& scratch,
                        Coherence coherence = Coherence::Low) const;

  /// hits[i] is the surface ray i meets first of those that cover all behind them. Returns how many rays were invalid.
  std::uint64_t closest_opaque(std::span<const RayRequest> rays, std::span<std::uint32_t> hits,
                               TraversalScratch& scratch, Coherence coherence = Coherence::Low) const;

  /// passed[i] is the share of light that gets through to the end of ray i: 0 behind anything opaque. Returns how many
  /// rays were invalid.
  std::uint64_t passed(std::span<const RayRequest> rays, std::span<float> passed, TraversalScratch& scratch) const;

  /// counts[i] is how many surfaces ray i meets on its whole way, however little they cover. Returns how many rays were
  /// invalid.
  std::uint64_t count_surfaces(std::span<const RayRequest> rays, std::span<std::uint32_t> counts,
                               TraversalScratch& scratch) const;

  /// The callback of visit_alpha_tested: ray i meets a surface that covers so much; returns whether the ray goes on.
  using Visit = std::function<bool(std::size_t ray, const SurfacePoint& point, double coverage)>;
  /// Calls `visit` for every surface of partial coverage along each ray, nearest first and by id where they lie in one
  /// plane, while it passes_on. Rays end at their reach, and where `ends` has planes, which cover all behind them,
  /// there: what lies in such a plane lies before it.
  void visit_alpha_tested(std::span<const RayRequest> rays, TraversalScratch& scratch, const Visit& visit,
                          std::span<const SurfacePlane> ends = {}) const;

  /// The plane of a surface where a ray meets it. `triangle` keeps what was loaded.
  [[nodiscard]] SurfacePlane plane_at(std::uint32_t surface, const RayRequest& ray, WorldTriangle& triangle) const;

  [[nodiscard]] const RayScene& opaque() const { return opaque_; }
  [[nodiscard]] const RaySpace& space() const { return space_; }
  [[nodiscard]] bool has_alpha_tested() const { return alpha_tested_ != nullptr; }

 private:
  std::uint64_t add_surfaces(const RayScene& scene, std::span<const RayRequest> rays, std::span<std::uint32_t> counts,
                             TraversalScratch& scratch) const;
  struct LayeredRays {
    std::span<const RayRequest> requests;
    std::span<const SurfacePlane> ends;  ///< per ray, or none at all

    [[nodiscard]] bool ends_at_plane(std::uint32_t ray) const {
      return !ends.empty() && ends[ray].normal != glm::dvec3(0.0);
    }
  };

  void push_waiting(const LayeredRays& rays, TraversalScratch& scratch) const;
  [[nodiscard]] bool add_layer(std::size_t i, const LayeredRays& rays, TraversalScratch& scratch,
                               WorldTriangle& triangle, const Visit& visit) const;
  [[nodiscard]] CoveringLayer layer_at(std::uint32_t surface, const RayRequest& ray, WorldTriangle& triangle) const;
  [[nodiscard]] double reach_past(const SurfacePlane& end, const RayRequest& ray) const;
  void push(const RayRequest& ray, RayBatch& batch) const;

  const Scene& scene_;
  const Surfaces& surfaces_;
  const RaySpace& space_;
  const RayScene& opaque_;
  const RayScene* alpha_tested_;
};

}  // namespace hpr
