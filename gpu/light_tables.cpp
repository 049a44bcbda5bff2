#include "gpu/light_tables.h"

#include <span>
#include <vector>

namespace hpr {

GpuLightTree upload_light_tree(GpuTables& tables, const LightTree& tree) {
  std::vector<GpuLightNode> nodes;
  nodes.reserve(tree.nodes().size());
  for (const LightTree::Node& node : tree.nodes()) {
    const LightCluster& lights = node.lights;
    nodes.push_back({lights.center, lights.radius, lights.half, lights.reach, lights.axis, lights.strength,
                     lights.cos_spread, lights.sin_spread, lights.cos_emission, lights.two_sided ? 1U : 0U, node.second,
                     node.light});
  }
  return {tables.upload(std::span<const GpuLightNode>(nodes)), tables.upload(tree.leaves()),
          static_cast<std::uint32_t>(nodes.size())};
}

GpuPunctualLight punctual_light_of(const Light& light) {
  return {light.position,
          light.range,
          light.radius,
          light.direction,
          light.intensity,
          light.inner_cone_radians,
          light.outer_cone_radians,
          light.angular_radius_radians,
          static_cast<std::uint32_t>(light.type)};
}

GpuEnvironment upload_environment(GpuTables& tables, const EnvironmentMap& map) {
  const Environment& environment = map.environment();
  GpuEnvironment made;
  made.texels = tables.upload(environment.image.pixels());
  made.facing = tables.upload(map.facing().sums());
  made.row_cosines = tables.upload(map.row_cosines());
  made.row_sums = tables.upload(map.row_sums());
  made.texel_sums = tables.upload(map.texel_sums());
  made.cell_powers = tables.upload(map.cell_powers());
  made.mean = map.mean();
  made.rotation_radians = environment.rotation_radians;
  made.scale = environment.scale;
  made.cosine_fraction = map.cosine_fraction();
  made.size = {environment.image.width(), environment.image.height()};
  made.cells = {map.cells().width, map.cells().height};
  return made;
}

}  // namespace hpr
