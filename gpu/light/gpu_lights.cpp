#include "gpu/light/gpu_lights.h"

#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "gpu/light/light_tables.h"

namespace hpr {
namespace {

/// As Lights of lights.glsl.
struct GpuLightsRoot {
  std::uint64_t punctual = 0;
  std::uint64_t triangles = 0;
  std::uint64_t environment = 0;
  std::uint64_t materials = 0;
  GpuLightTree tree;
  std::uint64_t in_tree = 0;
  std::uint64_t outside = 0;
  std::uint64_t outside_sums = 0;
  std::uint64_t power_sums = 0;
  std::uint64_t media = 0;
  glm::dvec3 background{0.0};
  glm::dvec3 lit_center{0.0};
  double lit_radius = 0.0;
  std::uint32_t punctual_count = 0;
  std::uint32_t triangles_count = 0;
  std::uint32_t enumerated = 0;
  std::uint32_t outside_count = 0;
  std::uint32_t first_triangle = 0;
  std::uint32_t power_sums_count = 0;
  std::uint32_t has_environment = 0;
  std::uint32_t has_media = 0;
};
static_assert(sizeof(GpuLightsRoot) == 184);

std::uint32_t count_of(std::size_t count) {
  return static_cast<std::uint32_t>(count);
}

}  // namespace

GpuLights::GpuLights(const GpuDevice& device, const Scene& scene, const LightSampler& sampler,
                     const GpuMaterials& materials)
    : tables_(device) {
  GpuLightsRoot root;
  root.materials = materials.address();

  std::vector<GpuPunctualLight> punctual;
  for (const Light& light : sampler.punctual()) punctual.push_back(punctual_light_of(light));
  root.punctual = tables_.upload(punctual);
  root.punctual_count = count_of(punctual.size());
  root.enumerated = count_of(sampler.enumerated());

  const TriangleLights& triangles = sampler.triangles();
  const std::vector<GpuTriangleLight> emitting = triangle_lights_of(scene, triangles);
  root.triangles = tables_.upload(emitting);
  root.triangles_count = count_of(emitting.size());

  root.background = {scene.background.r, scene.background.g, scene.background.b};
  if (sampler.environment_map()) {
    const GpuEnvironment environment = upload_environment(tables_, *sampler.environment_map());
    root.environment = tables_.upload_one(environment);
    root.has_environment = 1;
  }

  const LightSampler::Choices& choices = sampler.choices();
  root.tree = upload_light_tree(tables_, choices.tree);
  root.in_tree = tables_.upload(choices.in_tree);
  root.first_triangle = count_of(choices.first_triangle);
  root.outside = tables_.upload(choices.outside);
  root.outside_sums = tables_.upload(choices.outside_sums);
  root.outside_count = count_of(choices.outside.size());

  root.power_sums = tables_.upload(sampler.power_sums());
  root.power_sums_count = count_of(sampler.power_sums().size());
  root.media = tables_.upload(sampler.media());
  root.has_media = sampler.media().empty() ? 0 : 1;
  root.lit_center = sampler.lit_sphere().center;
  root.lit_radius = sampler.lit_sphere().radius;
  address_ = tables_.upload_one(root);
}

}  // namespace hpr
