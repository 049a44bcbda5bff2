#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <vector>

#include "rt/lighter.h"
#include "rt/lights/light_set.h"
#include "rt/materials/bsdf.h"
#include "rt/materials/medium.h"
#include "rt/passes/pixel_sums.h"
#include "rt/photons/photon_map.h"
#include "rt/sampling/sampler.h"
#include "rt/trace/ray_walk.h"
#include "rt/trace/surfaces.h"

namespace hpr {

/// A surface some pixel sees, directly or after reflections and refractions.
struct PathPoint {
  SurfacePoint surface;
  MaterialPoint material;
  Bsdf bsdf;
  glm::dvec3 throughput{1.0};   ///< what of its radiance reaches the pixel
  Media media;                  ///< on the viewer's side
  glm::dvec3 seen_from{0.0};    ///< the place before, where lights were sampled
  glm::dvec3 seen_normal{0.0};  ///< and its normal
  double seen_pdf = 0.0;        ///< density with which the way here was chosen; 0: it was the only one
  /// Per lobe: 0 when no ray follows it, else the inverse of the probability that one does.
  std::array<float, kLobes.size()> follows{};
  std::array<bool, kLobes.size()> may_follow{};  ///< whether one might have
  Sampler sampler;
  double share = 1.0;                       ///< of the pixel that the first surface of the path covers
  std::uint32_t pixel = 0;                  ///< index into PixelSums
  std::uint16_t depth = 0;                  ///< bounces from the eye
  std::uint16_t followed = 0;               ///< of those, by lobes that passes follow one by one
  Component component = Component::Direct;  ///< where its light counts
  ComponentSet borrows = 0;                 ///< that come from neighbours, see HalfResShading
  bool gathered = false;  ///< reached by rays that gather: what is to be looked at only lights nothing

  [[nodiscard]] bool borrows_light(Component which) const { return contains(borrows, which); }
};

/// Light that would fall on a point if nothing stood between.
struct DirectSample {
  std::uint32_t point = 0;  ///< index into Wave::points
  float visible = 1.0F;     ///< share that passes what stands between
  LightSample light;
  glm::dvec3 radiance{0.0};  ///< reflected towards the viewer and brought to the pixel
};

/// Points of one tile that are worked on together, and the light sampled for them, a few lights at a time.
struct Wave {
  std::vector<PathPoint> points;
  std::vector<DirectSample> samples;  ///< light by light, inside a light in the order of points
};

/// A ray on its way from a point to the next.
struct Following {
  const PathPoint* from = nullptr;
  glm::dvec3 throughput{0.0};
  double pdf = 0.0;
  Sampler sampler;
};

struct PhotonMaps;

/// What passes read while one thread lights one tile: the scene, its lights and rays, the settings, and the view.
struct LightContext {
  const Scene& scene;
  const Surfaces& surfaces;
  const RayWalk* rays;  ///< null when no pass needs rays
  const LightSet& lights;
  const RaySettings& settings;
  std::array<bool, kLobes.size()> followed_lobes{};  ///< whether a pass that follows the lobe runs
  bool gathers = false;                              ///< whether one runs that follows all the others
  const PhotonMaps* photons = nullptr;               ///< null when none were traced
  const View* view = nullptr;                        ///< the tile's view in any sample: the eye's position
  Media eye_media = {};                              ///< the media that the eye of that view lies in

  /// Whether a lobe is followed for itself, not by whoever follows the rest.
  [[nodiscard]] bool follows_for_itself(const Bsdf& bsdf, Lobe lobe) const;
};

/// Rays that one thread traces together: the requests and what they hit, how many were traced, and the memory that is
/// kept from call to call.
struct RayBuffers {
  std::vector<RayRequest> requests;
  std::vector<std::uint32_t> hits;   ///< per request: a surface, or kNoSurface
  std::vector<Following> following;  ///< per request of follow_lobe
  RayCounts counts;
  WalkScratch scratch;
  FoundPhotons found_photons;
  RecentTriangles triangles;
};

/// One kind of ray-traced light. Passes see a wave of points at a time and keep no state between calls, so a pass is
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

  /// Once per wave: reads its points; may add to the pixels' sums and put the points its rays reach into `next`.
  virtual void spread(const LightContext& /*context*/, const Wave& /*wave*/, RayBuffers& /*buffers*/,
                      PixelSums& /*sums*/, std::vector<PathPoint>& /*next*/) const {}

  /// Once per handful of lights: may hide direct samples of `wave`.
  virtual void hide(const LightContext& /*context*/, RayBuffers& /*buffers*/, PixelSums& /*sums*/,
                    Wave& /*wave*/) const {}
};

}  // namespace hpr
