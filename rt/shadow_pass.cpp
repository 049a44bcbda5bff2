#include <glm/geometric.hpp>
#include <limits>

#include "rt/pass.h"

namespace hpr {
namespace {

/// Hard shadows: one ray per direct sample of a light that casts.
class ShadowPass final : public Pass {
 public:
  [[nodiscard]] std::string_view name() const override { return "shadow"; }
  [[nodiscard]] const Requirement& requirement(const Requirements& scene) const override { return scene.shadow; }
  [[nodiscard]] bool needs_rays() const override { return true; }

  void hide(TileWork& tile, Wave& wave) const override {
    tile.batch.clear();
    for (const DirectSample& sample : wave.samples) {
      if (casts_shadows(tile.lights[sample.light])) push(tile, wave.points[sample.point].surface, sample);
    }
    tile.blocked.resize(tile.batch.size());
    tile.counts.shadow += tile.batch.size();
    tile.counts.invalid += tile.rays->occluded(tile.batch, tile.blocked);
    std::size_t ray = 0;
    for (DirectSample& sample : wave.samples) {
      if (casts_shadows(tile.lights[sample.light])) sample.visible = tile.blocked[ray++] == 0;
    }
  }

 private:
  static void push(TileWork& tile, const SurfacePoint& surface, const DirectSample& sample) {
    const glm::dvec3 origin = ray_origin(tile, surface, surface.lift);
    const Light& light = tile.lights[sample.light];
    if (light.type == LightType::Directional) {
      tile.batch.push(origin, sample.to_light, std::numeric_limits<double>::infinity());
      return;
    }
    // Aimed from the moved origin, and stopped short of the light by what rounding may add, so that a light that lies
    // on a surface is not hidden by it.
    const glm::dvec3 goal = tile.space.from_world(light.position);
    const glm::dvec3 way = goal - origin;
    const double distance = glm::length(way);
    const double size = std::max({std::abs(goal.x), std::abs(goal.y), std::abs(goal.z), 1.0});
    const double reach = distance * (1.0 - kOriginSteps * kFloatStep) - kOriginSteps * kFloatStep * size;
    tile.batch.push(origin, distance > 0.0 ? way / distance : sample.to_light, std::max(reach, 0.0));
  }
};

}  // namespace

std::unique_ptr<Pass> make_shadow_pass() {
  return std::make_unique<ShadowPass>();
}

}  // namespace hpr
