#include <glm/geometric.hpp>

#include "rt/passes/path_vertex.h"
#include "rt/photons/photon_query.h"
#include "rt/photons/photon_tracer.h"

namespace hpr {
namespace {

/// Indirect light: what photons that lights sent out bring to lobes that are not followed by rays. Caustics always,
/// all of it where settings ask for global photons.
class PhotonPass final : public Pass {
 public:
  [[nodiscard]] Requirement requirement(const Requirements& scene, const RaySettings& settings) const override {
    if (gathers_by_rays(scene, settings)) return {false, "rays gather what surfaces scatter on to others"};
    const bool focused =
        scene.shadow.needed && (scene.refraction.needed || follows_reflections(scene, settings.glossy_cutoff));
    if (settings.global_photons && !focused) return scene.indirect;
    if (focused && !may_take_photons(scene, settings.glossy_cutoff)) {
      return {false, "no material is matte, or as rough as the glossy cutoff, to show caustics"};
    }
    if (focused == scene.photon.needed) return scene.photon;
    return {focused, focused ? "lights reach materials smoother than the glossy cutoff, which bundle it into caustics"
                             : "no light is bundled by materials smoother than the glossy cutoff"};
  }
  [[nodiscard]] bool runs_by_default(const Requirements& scene, const RaySettings& settings) const override {
    return settings.photons > 0 && !gathers_by_rays(scene, settings);
  }

  void scatter(const LightContext& context, const Wavefront& wave, RayBuffers& buffers, PixelSums& sums,
               std::vector<PathVertex>& /*next*/) const override {
    if (context.photons == nullptr) return;
    for (const PathVertex& point : wave.vertices) {
      if (point.is_upsampled(Component::Photon)) continue;
      const PhotonMaps& maps = *context.photons;
      const auto gather = [&](const PhotonMap& map, double radius) {
        return gather_photons(map, radius, point.surface, point.bsdf, point.material.normal,
                              context.settings.glossy_cutoff, buffers.found_photons);
      };
      glm::dvec3 light = gather(maps.caustic, maps.caustic.radius());
      if (!context.gathers || point.gathers_near()) light += gather(maps.global, maps.global.radius());
      if (point.gathers_near()) {
        const double distance = glm::distance(point.surface.position, point.previous_position);
        for (const PhotonMap& map : maps.sparse) {
          light += gather(map, maps.sparse_radius(map, distance, point.previous_pdf));
        }
      }
      if (light != glm::dvec3(0.0)) {
        sums.add(point.pixel, component_after(point, Component::Photon), point.throughput * light);
      }
    }
  }
};

}  // namespace

std::unique_ptr<Pass> make_photon_pass() {
  return std::make_unique<PhotonPass>();
}

}  // namespace hpr
