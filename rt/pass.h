#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <string_view>
#include <vector>

#include "rt/brdf.h"
#include "rt/lighter.h"
#include "rt/lights.h"
#include "rt/ray_scene.h"
#include "rt/surfaces.h"

namespace hpr {

/// A surface some pixel sees, directly or after reflections.
struct PathPoint {
  SurfacePoint surface;
  MaterialPoint material;
  glm::dvec3 throughput{1.0};  ///< what of its radiance reaches the pixel
  std::uint32_t pixel = 0;     ///< of the tile
};

/// Light that would fall on a point if nothing stood between.
struct DirectSample {
  std::uint32_t point = 0;  ///< index into Wave::points
  std::uint32_t light = 0;
  bool visible = true;
  glm::dvec3 to_light{0.0};
  glm::dvec3 radiance{0.0};  ///< reflected towards the viewer
};

/// All points of one tile that are equally many bounces from the eye, and the light sampled for them, a few lights at a
/// time.
struct Wave {
  int depth = 0;
  std::vector<PathPoint> points;
  std::vector<DirectSample> samples;  ///< light by light, inside a light in the order of points
};

/// What passes need and write while one thread lights one tile.
struct TileWork {
  const Scene& scene;
  const Surfaces& surfaces;
  const RaySpace& space;
  const RayScene* rays;  ///< null when no pass needs rays
  std::span<const Light> lights;
  int max_depth;
  const View* view = nullptr;  ///< of the tile at hand

  std::vector<glm::dvec3> radiance;  ///< per pixel of the tile, summed in a fixed order
  RayCounts counts;
  RayBatch batch;
  std::vector<std::uint8_t> blocked;
  std::vector<std::uint32_t> hits;
};

/// One kind of ray-traced light. Passes see one generation of points at a time and keep no state between calls, so a
/// pass is shared by all threads.
class Pass {
 public:
  virtual ~Pass() = default;

  [[nodiscard]] virtual std::string_view name() const = 0;

  /// Whether the scene can show what this pass adds.
  [[nodiscard]] virtual const Requirement& requirement(const Requirements& scene) const = 0;

  [[nodiscard]] virtual bool needs_rays() const = 0;

  /// Once per wave: reads its points; may add to the tile's radiance and put the points its rays reach into `next`.
  virtual void spread(TileWork& /*tile*/, const Wave& /*wave*/, Wave& /*next*/) const {}

  /// Once per handful of lights: may hide direct samples of `wave`.
  virtual void hide(TileWork& /*tile*/, Wave& /*wave*/) const {}
};

/// All passes there are, in the order they run.
[[nodiscard]] std::vector<std::unique_ptr<Pass>> make_all_passes();

[[nodiscard]] std::unique_ptr<Pass> make_shadow_pass();
[[nodiscard]] std::unique_ptr<Pass> make_reflection_pass();

/// Where rays leave a point on its viewer's side, in ray space.
[[nodiscard]] inline glm::dvec3 ray_origin(const TileWork& tile, const SurfacePoint& point, const glm::dvec3& lift) {
  return tile.space.from_world(point.position + lift + point.offset * point.geometric_normal);
}

}  // namespace hpr
