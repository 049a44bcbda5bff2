#include <algorithm>
#include <array>
#include <span>

#include "rt/passes/path_vertex.h"
#include "rt/photons/photon_query.h"

/// The passes that follow lobes of surfaces by rays.
namespace hpr {
namespace {

std::array<Lobe, 2> lobe_and_extension(PassId pass) {
  const Lobe lobe = *info_of(pass).lobe;
  return {lobe, extension_of(lobe)};
}

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

  [[nodiscard]] std::span<const Lobe> lobes() const override { return lobes_; }

 private:
  std::array<Lobe, 2> lobes_ = lobe_and_extension(PassId::Reflection);
};

/// What is seen through surfaces, bent by solids and straight through sheets, clear and frosted: one ray per point.
class RefractionPass final : public Pass {
 public:
  [[nodiscard]] Requirement requirement(const Requirements& scene, const RaySettings& /*settings*/) const override {
    return scene.refraction;
  }

  [[nodiscard]] std::span<const Lobe> lobes() const override { return lobes_; }

 private:
  std::array<Lobe, 2> lobes_ = lobe_and_extension(PassId::Refraction);
};

/// Indirect light along rays: lobes that no other pass follows are followed too, so that paths go on until they leave
/// the scene. What photons do where lights are small, without their blur; the light of a constant environment comes
/// that way too.
class GatherPass final : public Pass {
 public:
  [[nodiscard]] Requirement requirement(const Requirements& scene, const RaySettings& settings) const override {
    if (!scene.indirect.needed || gathers_by_rays(scene, settings)) return scene.indirect;
    if (final_gathers(scene, settings)) return {true, "surfaces scatter light on to others, where photons tell of it"};
    return {false, "photons are to bring what light surfaces scatter on, if anything is"};
  }
  [[nodiscard]] bool runs_by_default(const Requirements& scene, const RaySettings& settings) const override {
    return gathers_by_rays(scene, settings) || final_gathers(scene, settings);
  }

  [[nodiscard]] std::span<const Lobe> lobes() const override { return kLobes; }
};

/// Whether all indirect light is wanted, and nobody says which pass is to bring it.
bool leaves_indirect_open(const RaySettings& settings) {
  return settings.photons > 0 && settings.passes.empty() && (settings.auto_passes || settings.all_passes) &&
         settings.global_photons && settings.half_resolution.empty();
}

}  // namespace

std::unique_ptr<Pass> make_reflection_pass() {
  return std::make_unique<ReflectionPass>();
}

std::unique_ptr<Pass> make_refraction_pass() {
  return std::make_unique<RefractionPass>();
}

bool gathers_by_rays(const Requirements& scene, const RaySettings& settings) {
  if (std::ranges::find(settings.passes, PassId::Gather) != settings.passes.end()) return true;
  return leaves_indirect_open(settings) && settings.gather && scene.even_environment;
}

bool final_gathers(const Requirements& scene, const RaySettings& settings) {
  return leaves_indirect_open(settings) && settings.final_gather && !gathers_by_rays(scene, settings);
}

std::unique_ptr<Pass> make_gather_pass() {
  return std::make_unique<GatherPass>();
}

}  // namespace hpr
