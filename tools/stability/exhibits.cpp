#include "tools/stability/exhibits.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>

#include "scene/generators/shapes.h"
#include "tools/stability/tools.h"

namespace hpr::stability {
namespace {

glm::dvec3 snapped(const glm::dvec3& place, double steps_per_metre) {
  return steps_per_metre > 0.0 ? glm::round(place * steps_per_metre) / steps_per_metre : place;
}

std::uint32_t add_material(Scene& scene, const glm::vec3& color, float metallic, float roughness) {
  Material material;
  material.base_color = glm::vec4(color, 1.0F);
  material.metallic = metallic;
  material.roughness = roughness;
  scene.materials.push_back(material);
  return static_cast<std::uint32_t>(scene.materials.size() - 1);
}

void scale_lights(Scene& scene, double factor) {
  for (Light& light : scene.lights) {
    light.position *= factor;
    light.range *= factor;
    light.radius *= factor;
    if (light.type == LightType::Point || light.type == LightType::Spot) {
      light.intensity *= static_cast<float>(factor * factor);
    }
  }
  for (Material& material : scene.materials) {
    material.thickness *= static_cast<float>(factor);
    material.attenuation_distance *= static_cast<float>(factor);
  }
}

}  // namespace

Scene exhibits(double steps_per_metre) {
  Scene scene;
  const std::uint32_t floor = add_material(scene, {0.6F, 0.55F, 0.5F}, 0.0F, 0.6F);
  const std::uint32_t matte = add_material(scene, {0.7F, 0.2F, 0.15F}, 0.0F, 1.0F);
  const std::uint32_t mirror = add_material(scene, {0.9F, 0.9F, 0.9F}, 1.0F, 0.0F);
  const std::uint32_t glass = add_material(scene, {1.0F, 1.0F, 1.0F}, 0.0F, 0.0F);
  scene.materials[glass].transmission = 1.0F;
  scene.materials[glass].thickness = 1.0F;
  scene.materials[glass].attenuation_color = {0.4F, 0.8F, 0.5F};
  scene.materials[glass].attenuation_distance = 0.5F;
  const std::uint32_t panel = add_material(scene, {0.0F, 0.0F, 0.0F}, 0.0F, 1.0F);
  scene.materials[panel].emissive = {3.0F, 2.5F, 2.0F};

  const auto placed = [&](Mesh mesh, std::uint32_t material, const glm::dvec3& at, double scale, double turned) {
    mesh.material = material;
    const glm::dmat4 moved = glm::translate(glm::dmat4(1.0), snapped(at, steps_per_metre));
    const glm::dmat4 rotated = glm::rotate(moved, turned, glm::dvec3(0.6, 0.8, 0.0));
    add(scene, std::move(mesh), glm::scale(rotated, glm::dvec3(scale)));
  };
  Mesh ground;
  shapes::add_quad(ground, {glm::dvec3(-3, 0, 3), {3, 0, 3}, {3, 0, -3}, {-3, 0, -3}});
  placed(ground, floor, {0.0123, 0.0, 0.0345}, 1.0, 0.0);
  placed(shapes::icosphere(3), matte, {-1.1037, 0.5013, -0.3071}, 0.5, 0.3);
  placed(shapes::icosphere(3), mirror, {0.1279, 0.6117, -1.0093}, 0.61, 0.0);
  placed(shapes::icosphere(3), glass, {0.9531, 0.4711, 0.2113}, 0.45, 1.1);
  Mesh box;
  shapes::add_box(box, {-0.3, -0.3, -0.3}, {0.3, 0.3, 0.3});
  placed(box, matte, {-0.4173, 0.4519, 0.8067}, 1.0, 0.7);
  Mesh lamp;
  shapes::add_quad(lamp, {glm::dvec3(-0.5, 0, -0.5), {0.5, 0, -0.5}, {0.5, 0, 0.5}, {-0.5, 0, 0.5}});
  placed(lamp, panel, {-1.5071, 2.6031, 0.5013}, 1.0, 0.0);

  Light point;
  point.position = snapped({1.7011, 2.4037, 1.2093}, steps_per_metre);
  point.intensity = glm::vec3(6.0F);
  Light sun;
  sun.type = LightType::Directional;
  sun.direction = glm::normalize(glm::vec3(-0.4F, -1.0F, -0.6F));
  sun.intensity = glm::vec3(0.8F);
  scene.lights = {point, sun};
  scene.background = {0.15F, 0.2F, 0.3F};
  finish_scene(scene);
  return scene;
}

View exhibits_view(double steps_per_metre) {
  const glm::dvec3 eye = snapped({0.3071, 1.6019, 3.7033}, steps_per_metre);
  const glm::dvec3 at = snapped({-0.1013, 0.5017, -0.2051}, steps_per_metre);
  View view = make_view(look_at(eye, at, {0.0, 1.0, 0.0}, 0.8), {256, 192}, {});
  view.near_distance = 0x1p-7;
  return view;
}

RaySettings exhibits_light() {
  RaySettings settings;
  settings.passes = {PassId::Shadow, PassId::Reflection, PassId::Refraction, PassId::Photon};
  settings.photons = 20'000;
  return settings;
}

void scale_placements(Scene& scene, double factor) {
  for (Instance& instance : scene.instances) {
    for (int column = 0; column < 4; ++column) {
      for (int row = 0; row < 3; ++row) instance.to_world[column][row] *= factor;
    }
  }
  scale_lights(scene, factor);
  finish_scene(scene);
}

void scale_vertices(Scene& scene, double factor) {
  for (Mesh& mesh : scene.meshes) {
    for (glm::vec3& position : mesh.positions) position = glm::vec3(glm::dvec3(position) * factor);
  }
  for (Instance& instance : scene.instances) {
    for (int row = 0; row < 3; ++row) instance.to_world[3][row] *= factor;
  }
  scale_lights(scene, factor);
  finish_scene(scene);
}

void scale_view(View& view, double factor) {
  view.eye *= factor;
  view.near_distance *= factor;
}

void move_placements(Scene& scene, const glm::dvec3& offset) {
  for (Instance& instance : scene.instances) instance.to_world[3] += glm::dvec4(offset, 0.0);
  for (Light& light : scene.lights) light.position += offset;
  finish_scene(scene);
}

void move_vertices(Scene& scene, const glm::dvec3& offset) {
  for (Instance& instance : scene.instances) {
    Mesh& mesh = scene.meshes[instance.mesh];
    for (glm::vec3& position : mesh.positions) position = glm::vec3(world_position(instance, position) + offset);
    const glm::dmat3 linear(instance.to_world);
    for (glm::vec3& normal : mesh.normals) normal = glm::vec3(glm::normalize(linear * glm::dvec3(normal)));
    instance.to_world = glm::dmat4(1.0);
  }
  for (Light& light : scene.lights) light.position += offset;
  finish_scene(scene);
}

}  // namespace hpr::stability
