#include "rt/passes/pass.h"

namespace hpr {
namespace {

/// What is seen through surfaces, bent by solids and straight through sheets, clear and frosted: one ray per point.
class RefractionPass final : public Pass {
 public:
  [[nodiscard]] std::string_view name() const override { return "refraction"; }
  [[nodiscard]] Requirement requirement(const Requirements& scene, const RaySettings& /*settings*/) const override {
    return scene.refraction;
  }
  [[nodiscard]] const Lobe* follows() const override { return &kLobe; }

  void spread(TileWork& tile, const Wave& wave, std::vector<PathPoint>& next) const override {
    follow_lobe(tile, wave, {kLobe, Component::Refraction}, tile.counts.refraction, next);
  }

 private:
  static constexpr Lobe kLobe = Lobe::Transmission;
};

}  // namespace

std::unique_ptr<Pass> make_refraction_pass() {
  return std::make_unique<RefractionPass>();
}

}  // namespace hpr
