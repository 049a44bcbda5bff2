#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "gpu/device/gpu_tables.h"
#include "rt/lights/environment_map.h"
#include "rt/lights/light_tree.h"
#include "rt/lights/triangle_lights.h"
#include "scene/scene.h"

/// What lights are sampled by, laid out as shaders read it: plain data, and addresses of more of it.
namespace hpr {

/// As LightNode of light_tree.glsl.
struct GpuLightNode {
  glm::dvec3 center{0.0};
  double radius = 0.0;
  glm::dvec3 half_box{0.0};
  double reach = 0.0;
  glm::dvec3 axis{0.0};
  double strength = 0.0;
  double cos_spread = 1.0;
  double sin_spread = 0.0;
  double cos_emission = 0.0;
  std::uint32_t two_sided = 0;
  std::uint32_t second = 0;
  std::uint32_t light = 0;
  std::uint32_t padding = 0;
};
static_assert(sizeof(GpuLightNode) == 136);

/// As LightTree of light_tree.glsl.
struct GpuLightTree {
  std::uint64_t nodes = 0;
  std::uint64_t leaf_of = 0;
  std::uint32_t nodes_count = 0;
  std::uint32_t padding = 0;
};
static_assert(sizeof(GpuLightTree) == 24);

/// As PunctualLight of punctual_lights.glsl.
struct GpuPunctualLight {
  glm::dvec3 position{0.0};
  double range = 0.0;
  double radius = 0.0;
  glm::vec3 direction{0.0F};
  glm::vec3 intensity{0.0F};
  float inner_cone_radians = 0.0F;
  float outer_cone_radians = 0.0F;
  float angular_radius_radians = 0.0F;
  std::uint32_t type = 0;
};
static_assert(sizeof(GpuPunctualLight) == 80);

/// As Environment of environment.glsl.
struct GpuEnvironment {
  std::uint64_t texels = 0;
  std::uint64_t facing = 0;
  std::uint64_t row_cosines = 0;
  std::uint64_t row_sums = 0;
  std::uint64_t texel_sums = 0;
  std::uint64_t cell_powers = 0;
  glm::dvec3 mean{0.0};
  double rotation_radians = 0.0;
  double scale = 1.0;
  double cosine_fraction = 1.0;
  glm::ivec2 size{0};
  glm::ivec2 cells{0};
};
static_assert(sizeof(GpuEnvironment) == 112);

/// As TriangleLight of triangle_lights.glsl.
struct GpuTriangleLight {
  glm::dvec3 v0{0.0};
  glm::dvec3 e1{0.0};
  glm::dvec3 e2{0.0};
  glm::dvec3 normal{0.0};
  double area = 0.0;
  double offset = 0.0;
  std::array<std::array<glm::vec2, 3>, 2> uv{};
  std::array<float, 3> alpha{};
  std::uint32_t has_colors = 0;
  std::uint32_t material = 0;
  std::uint32_t surface = 0;
  std::uint32_t two_sided = 0;
  std::uint32_t padding = 0;
};
static_assert(sizeof(GpuTriangleLight) == 192);

[[nodiscard]] GpuLightTree upload_light_tree(GpuTables& tables, const LightTree& tree);
[[nodiscard]] GpuPunctualLight punctual_light_of(const Light& light);
/// By surface id. `scene`: whose lights they are.
[[nodiscard]] std::vector<GpuTriangleLight> triangle_lights_of(const Scene& scene, const TriangleLights& triangles);
[[nodiscard]] GpuEnvironment upload_environment(GpuTables& tables, const EnvironmentMap& map);

}  // namespace hpr
