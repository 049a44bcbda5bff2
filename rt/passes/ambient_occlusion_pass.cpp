#include <algorithm>
#include <glm/geometric.hpp>

#include "rt/passes/path_vertex.h"

namespace hpr {
namespace {

/// A stand-in for indirect light, cheap and not physical: an even light from all sides that surfaces near by keep out
/// (Zhukov, Iones, Kronin 1998). Runs only where it is asked for; photons do it right.
class AmbientOcclusionPass final : public Pass {
 public:
  [[nodiscard]] Requirement requirement(const Requirements& scene, const RaySettings& /*settings*/) const override {
    return scene.ambient_occlusion;
  }
  [[nodiscard]] bool runs_by_default(const Requirements& /*scene*/, const RaySettings& /*settings*/) const override {
    return false;
  }

  void scatter(const LightContext& context, const Wavefront& wave, RayBuffers& buffers, PixelSums& sums,
               std::vector<PathVertex>& /*next*/) const override {
    const int count = context.settings.occlusion_rays;
    std::vector<glm::dvec3> light;
    buffers.requests.clear();
    const double reach = occlusion_reach(context.scene);
    for (std::uint32_t i = 0; i < wave.vertices.size(); ++i) {
      const PathVertex& point = wave.vertices[i];
      if (point.is_upsampled(Component::AmbientOcclusion)) continue;
      if (point.bsdf.weight(Lobe::Diffuse) == glm::dvec3(0.0)) continue;
      Sampler sampler = point.sampler.branch(kBranch);
      for (int ray = 0; ray < count; ++ray) {
        const auto sample = point.bsdf.sample(Lobe::Diffuse, sampler.two());
        if (!sample) continue;
        buffers.requests.push_back(
            {ray_origin(point.surface, sample->direction) + point.surface.lift, sample->direction, reach, nullptr, i});
        light.push_back(point.throughput * sample->weight * point.material.occlusion * context.settings.ambient /
                        static_cast<double>(count));
        sums.count_ray(point.pixel);
      }
    }
    std::vector<float> passed(buffers.requests.size());
    buffers.counts[PassId::AmbientOcclusion] += buffers.requests.size();
    buffers.scratch.batch.purpose = {RayKind::Occlusion, wave.generation()};
    buffers.counts.invalid += context.rays->passed(buffers.requests, passed, buffers.scratch);
    for (std::size_t i = 0; i < passed.size(); ++i) {
      const PathVertex& point = wave.vertices[buffers.requests[i].owner];
      sums.add(point.pixel, component_after(point, Component::AmbientOcclusion),
               static_cast<double>(passed[i]) * light[i]);
    }
  }

 private:
  static constexpr std::uint32_t kBranch = 16;
};

}  // namespace

std::unique_ptr<Pass> make_ambient_occlusion_pass() {
  return std::make_unique<AmbientOcclusionPass>();
}

}  // namespace hpr
