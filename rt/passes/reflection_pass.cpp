#include "rt/passes/pass.h"
#include "rt/photons/photon_query.h"

namespace hpr {
namespace {

/// Mirror images, sharp and blurred: one ray per point along its specular reflection.
class ReflectionPass final : public Pass {
 public:
  /// Settings may follow rougher surfaces than those that mirror to the eye, or smoother ones alone; what is followed
  /// takes no photons.
  [[nodiscard]] Requirement requirement(const Requirements& scene, const RaySettings& settings) const override {
    const bool followed = follows_reflections(scene, settings.glossy_cutoff);
    if (followed == scene.reflection.needed) return scene.reflection;
    return {followed, followed ? "materials are smoother than the glossy cutoff"
                               : "no material is smoother than the glossy cutoff"};
  }

  void spread(const LightContext& context, const Wave& wave, RayBuffers& buffers, PixelSums& sums,
              std::vector<PathPoint>& next) const override {
    const PassInfo& pass = info_of(PassId::Reflection);
    follow_lobe(context, wave, pass, *pass.lobe, buffers, sums, next);
  }
};

}  // namespace

std::unique_ptr<Pass> make_reflection_pass() {
  return std::make_unique<ReflectionPass>();
}

}  // namespace hpr
