#include "rt/passes/pass.h"

namespace hpr {
namespace {

/// What is seen through surfaces, bent by solids and straight through sheets, clear and frosted: one ray per point.
class RefractionPass final : public Pass {
 public:
  [[nodiscard]] Requirement requirement(const Requirements& scene, const RaySettings& /*settings*/) const override {
    return scene.refraction;
  }

  void spread(const LightContext& context, const Wave& wave, RayBuffers& buffers, PixelSums& sums,
              std::vector<PathPoint>& next) const override {
    const PassInfo& pass = info_of(PassId::Refraction);
    follow_lobe(context, wave, pass, *pass.lobe, buffers, sums, next);
  }
};

}  // namespace

std::unique_ptr<Pass> make_refraction_pass() {
  return std::make_unique<RefractionPass>();
}

}  // namespace hpr
