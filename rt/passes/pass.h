#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "rt/lights/light_sampler.h"
#include "rt/materials/bsdf.h"
#include "rt/materials/medium.h"
#include "rt/passes/pass_list.h"
#include "rt/passes/pixel_sums.h"
#include "rt/photons/photon_map.h"
#include "rt/ray_counts.h"
#include "rt/ray_settings.h"
#include "rt/sampling/sampler.h"
#include "rt/trace/coverage_traversal.h"
#include "rt/trace/surfaces.h"

namespace hpr {

/// A vertex of a path from the eye: a surface that a pixel shows, directly or after reflections and refractions (Veach
/// 1997).
struct PathVertex {
  explicit PathVertex(const SurfacePoint& at) : surface(at) {}
  /// Where a ray meets `triangle`.
  PathVertex(const Surfaces& surfaces, const WorldTriangle& triangle, const glm::dvec3& origin,
             const glm::dvec3& direction)
      : surface(surfaces.meet(triangle, origin, direction)) {}

  SurfacePoint surface;
  MaterialPoint material;
  Bsdf bsdf;
  glm::dvec3 throughput{1.0};         ///< the fraction of its radiance that reaches the pixel
  Media media;                        ///< on the viewer's side
  glm::dvec3 previous_position{0.0};  ///< the vertex before, where lights were sampled
  glm::dvec3 previous_normal{0.0};    ///< the light normal of that vertex
  /// Density with which the direction here was chosen, per solid angle; 0: it was the only one.
  double previous_pdf = 0.0;
  /// Per lobe: 0 when no ray follows it, else the inverse of the probability that one does.
  std::array<float, kLobes.size()> lobe_weights{};
  std::array<bool, kLobes.size()> may_follow{};  ///< per lobe: whether one might have followed it
  Sampler sampler;
  /// Metres from within which rays gather light, and photons bring what comes from further (PhotonMaps::near).
  double gather_reach = std::numeric_limits<double>::infinity();
  double coverage = 1.0;                    ///< of the pixel that the first surface of the path covers
  std::uint32_t pixel = 0;                  ///< index into PixelSums
  std::uint16_t depth = 0;                  ///< bounces from the eye
  std::uint16_t followed = 0;               ///< bounces by lobes that passes follow one by one
  Component component = Component::Direct;  ///< where its light counts
  ComponentSet upsampled = 0;               ///< components that HalfResShading brings from neighbor taps
  /// Reached by rays that gather: unlit surfaces and backgrounds are no light for the vertex.
  bool gathered = false;
  /// Of final gathering: reached by lobes that passes follow for themselves, from where light was gathered: the light
  /// that lamps send this way is what caustic photons bring there.
  bool is_caustic = false;

  [[nodiscard]] bool is_upsampled(Component which) const { return contains(upsampled, which); }
  [[nodiscard]] bool gathers_near() const { return std::isfinite(gather_reach); }
};

/// Light that would fall on a vertex if nothing stood between.
struct DirectSample {
  std::uint32_t point = 0;  ///< index into Wavefront::vertices
  float visible = 1.0F;     ///< fraction that passes what stands between
  LightSample light;
  glm::dvec3 radiance{0.0};  ///< reflected towards the viewer and brought to the pixel
};

/// A wavefront: vertices of one tile that are shaded together, and the light sampled for them, a few lights at a time.
struct Wavefront {
  std::vector<PathVertex> vertices;
  std::vector<DirectSample> samples;  ///< light by light, inside a light in the order of vertices

  /// Of the rays that leave its vertices, which are all as many bounces from the eye.
  [[nodiscard]] std::uint16_t generation() const {
    return vertices.empty() ? std::uint16_t{0} : static_cast<std::uint16_t>(vertices.front().depth + 1);
  }
};

/// A ray along a lobe of a vertex.
struct LobeRay {
  const PathVertex* from = nullptr;
  glm::dvec3 throughput{0.0};
  double pdf = 0.0;
  Sampler sampler;
};

struct PhotonMaps;

/// What passes read while one thread shades one tile: the scene, its lights and rays, the settings, and the view.
struct LightContext {
  const Scene& scene;
  const Surfaces& surfaces;
  const CoverageTraversal* rays;  ///< null when no pass needs rays
  const LightSampler& lights;
  const RaySettings& settings;
  std::array<bool, kLobes.size()> followed_lobes{};  ///< whether a pass that follows the lobe runs
  bool gathers = false;                              ///< whether one runs that follows all the others
  const PhotonMaps* photons = nullptr;               ///< null when none were traced
  const View* view = nullptr;                        ///< the tile's view in any sample: the eye's position
  Media eye_media = {};                              ///< the media that the eye of that view lies in

  /// The radiance that the eye sees along `direction` past all surfaces.
  [[nodiscard]] glm::dvec3 background(const glm::dvec3& direction) const;
  /// That radiance where no direction changes it.
  [[nodiscard]] std::optional<glm::dvec3> even_background() const;

  /// Whether rays gather what photons tell (RaySettings::final_gather).
  [[nodiscard]] bool final_gathers() const { return gathers && photons != nullptr; }
  /// Whether that is how light is gathered at a vertex: what lobes that passes follow for themselves make there of
  /// lamps and skies is then left to caustic photons, at the vertex that light is gathered for.
  [[nodiscard]] bool leaves_caustics(const PathVertex& point) const { return final_gathers() && point.gathered; }
  /// Whether a pass of its own follows the lobe, and not the one that gathers all others.
  [[nodiscard]] bool follows_for_itself(const Bsdf& bsdf, Lobe lobe) const;
};

/// Rays that one thread traces together: the requests and what they hit, how many were traced, and the memory that is
/// kept from call to call.
struct RayBuffers {
  std::vector<RayRequest> requests;
  std::vector<std::uint32_t> hits;  ///< per request: a surface, or kNoSurface
  std::vector<LobeRay> lobe_rays;   ///< of all passes that follow lobes, pass after pass
  std::vector<RayRequest> lobe_requests;
  std::vector<std::uint32_t> lobe_hits;
  RayCounts counts;
  TraversalScratch scratch;
  FoundPhotons found_photons;
  RecentTriangles triangles;
};

/// One kind of ray-traced light. Passes process a wavefront at a time and keep no state between calls, so a pass is
/// shared by all threads.
class Pass {
 public:
  virtual ~Pass() = default;

  /// Whether the scene can show what this pass adds.
  [[nodiscard]] virtual Requirement requirement(const Requirements& scene, const RaySettings& settings) const = 0;

  /// Whether it runs where the scene requires it and nobody names it.
  [[nodiscard]] virtual bool runs_by_default(const Requirements& /*scene*/, const RaySettings& /*settings*/) const {
    return true;
  }

  /// The lobes that it follows by rays, which are traced together with those of other passes (LobeRays).
  [[nodiscard]] virtual std::span<const Lobe> lobes() const { return {}; }

  /// Once per wavefront: reads its vertices; may add to the pixels' sums and append vertices to `next`.
  virtual void scatter(const LightContext& /*context*/, const Wavefront& /*wave*/, RayBuffers& /*buffers*/,
                       PixelSums& /*sums*/, std::vector<PathVertex>& /*next*/) const {}

  /// Once per kLightsAtOnce lights: may set the visibility of direct samples of `wave`.
  virtual void trace_shadows(const LightContext& /*context*/, RayBuffers& /*buffers*/, PixelSums& /*sums*/,
                             Wavefront& /*wave*/) const {}
};

}  // namespace hpr
