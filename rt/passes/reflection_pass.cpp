#include "rt/passes/pass.h"
#include "rt/photons/photon_gather.h"

namespace hpr {
namespace {

/// Mirror images, sharp and blurred: one ray per point along its specular reflection.
class ReflectionPass final : public Pass {
 public:
  [[nodiscard]] std::string_view name() const override { return "reflection"; }
  /// Settings may follow rougher surfaces than those that mirror to the eye, or smoother ones alone; what is followed
  /// takes no photons.
  [[nodiscard]] Requirement requirement(const Requirements& scene, const RaySettings& settings) const override {
    const bool followed = follows_reflections(scene, settings.glossy_cutoff);
    if (followed == scene.reflection.needed) return scene.reflection;
    return {followed, followed ? "materials are smoother than the glossy cutoff"
                               : "no material is smoother than the glossy cutoff"};
  }
  [[nodiscard]] const Lobe* follows() const override { return &kLobe; }

  void spread(TileWork& tile, const Wave& wave, std::vector<PathPoint>& next) const override {
    follow_lobe(tile, wave, {kLobe, Component::Reflection}, tile.counts.reflection, next);
  }

 private:
  static constexpr Lobe kLobe = Lobe::Reflection;
};

}  // namespace

std::unique_ptr<Pass> make_reflection_pass() {
  return std::make_unique<ReflectionPass>();
}

}  // namespace hpr
