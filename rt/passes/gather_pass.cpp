#include <algorithm>

#include "rt/passes/pass.h"

namespace hpr {
namespace {

/// Indirect light along rays: lobes that no other pass follows are followed too, so that paths go on until they leave
/// the scene. What photons do where lights are small, without their blur; an even sky's own light comes the same way.
class GatherPass final : public Pass {
 public:
  [[nodiscard]] Requirement requirement(const Requirements& scene, const RaySettings& settings) const override {
    if (!scene.indirect.needed || gathers_by_rays(scene, settings)) return scene.indirect;
    return {false, "photons are to bring what light surfaces scatter on, if anything is"};
  }
  [[nodiscard]] bool runs_by_default(const Requirements& scene, const RaySettings& settings) const override {
    return gathers_by_rays(scene, settings);
  }

  void spread(const LightContext& context, const Wave& wave, RayBuffers& buffers, PixelSums& sums,
              std::vector<PathPoint>& next) const override {
    for (const Lobe lobe : kLobes) follow_lobe(context, wave, info_of(PassId::Gather), lobe, buffers, sums, next);
  }
};

}  // namespace

bool gathers_by_rays(const Requirements& scene, const RaySettings& settings) {
  if (std::ranges::find(settings.passes, PassId::Gather) != settings.passes.end()) return true;
  return settings.photons > 0 && settings.passes.empty() && (settings.auto_passes || settings.all_passes) &&
         settings.global_photons && settings.gather && scene.constant_environment && settings.half_resolution.empty();
}

std::unique_ptr<Pass> make_gather_pass() {
  return std::make_unique<GatherPass>();
}

}  // namespace hpr
