#include "gpu/light/light_tables.h"

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
  return {tables.upload(std::span(nodes)), tables.upload(tree.leaves()), static_cast<std::uint32_t>(nodes.size())};
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

std::vector<GpuTriangleLight> triangle_lights_of(const Scene& scene, const TriangleLights& triangles) {
  std::vector<GpuTriangleLight> made(triangles.size());
  for (std::size_t i = 0; i < made.size(); ++i) {
    const TriangleLight& from = triangles[i];
    const Mesh& mesh = scene.mesh_of(scene.instances[from.instance]);
    const glm::uvec3& corners = mesh.triangles[from.index];
    GpuTriangleLight& light = made[i];
    light.v0 = from.v0;
    light.e1 = from.e1;
    light.e2 = from.e2;
    light.normal = from.normal;
    light.area = from.area;
    light.offset = from.offset;
    light.has_colors = mesh.colors.empty() ? 0 : 1;
    light.material = mesh.material;
    light.surface = from.surface;
    light.two_sided = from.two_sided ? 1 : 0;
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const std::uint32_t vertex = corners[static_cast<int>(corner)];
      if (light.has_colors != 0) light.alpha.at(corner) = mesh.colors[vertex].a;
      for (std::size_t set = 0; set < mesh.uvs.size(); ++set) {
        if (!mesh.uvs.at(set).empty()) light.uv.at(set).at(corner) = mesh.uvs.at(set)[vertex];
      }
    }
  }
  return made;
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
