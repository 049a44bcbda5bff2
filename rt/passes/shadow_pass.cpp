#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "rt/passes/pass.h"

namespace hpr {
namespace {

/// Shadows, hard and soft: one ray per direct sample. Lights with an extent are sampled at a place of chance, so that
/// their shadows soften.
class ShadowPass final : public Pass {
 public:
  [[nodiscard]] Requirement requirement(const Requirements& scene, const RaySettings& settings) const override {
    if (scene.constant_environment && gathers_by_rays(scene, settings)) {
      return {false, "rays that gather light find an even sky, and what hides it"};
    }
    return scene.shadow;
  }

  void trace_shadows(const LightContext& context, RayBuffers& buffers, PixelSums& sums,
                     Wavefront& wave) const override {
    buffers.requests.clear();
    for (std::uint32_t i = 0; i < wave.samples.size(); ++i) {
      const DirectSample& sample = wave.samples[i];
      if (!sample.light.casts_shadows) continue;
      const PathVertex& point = wave.vertices[sample.point];
      buffers.requests.push_back(towards(context, point, sample.light));
      buffers.requests.back().owner = i;
      sums.count_ray(point.pixel);
    }
    std::vector<float> passed(buffers.requests.size());
    buffers.counts[PassId::Shadow] += buffers.requests.size();
    buffers.scratch.batch.purpose = {RayKind::Shadow, wave.generation()};
    buffers.counts.invalid += context.rays->passed(buffers.requests, passed, buffers.scratch);
    for (std::size_t i = 0; i < passed.size(); ++i) wave.samples[buffers.requests[i].owner].visible = passed[i];
  }

 private:
  static RayRequest towards(const LightContext& context, const PathVertex& point, const LightSample& light) {
    RayRequest ray;
    ray.origin = ray_origin(point.surface, light.to_light);
    const bool viewers_side = glm::dot(light.to_light, point.surface.geometric_normal) > 0.0;
    if (context.settings.terminator_fix && viewers_side) ray.origin += point.surface.lift;
    ray.direction = light.to_light;
    ray.reach = light.distance;
    if (!std::isfinite(light.distance)) return ray;
    // Aimed from the moved origin, and stopped short of the light by what rounding may add, so that a light that lies
    // on a surface is not hidden by it.
    const glm::dvec3 to_goal = light.goal - ray.origin;
    const double distance = glm::length(to_goal);
    const double before =
        kOriginSteps * kFloatStep * distance + std::max(light.offset, context.rays->space().rounding_at(light.goal));
    ray.reach = std::max(distance - before, 0.0);
    if (distance > 0.0) ray.direction = to_goal / distance;
    return ray;
  }
};

}  // namespace

std::unique_ptr<Pass> make_shadow_pass() {
  return std::make_unique<ShadowPass>();
}

}  // namespace hpr
