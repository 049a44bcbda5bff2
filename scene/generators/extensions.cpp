#include <cstddef>
#include <functional>
#include <glm/geometric.hpp>
#include <memory>
#include <string>
#include <utility>

#include "scene/generators/generators.h"
#include "scene/generators/shapes.h"
#include "scene/studio.h"

namespace hpr {
namespace {

constexpr int kColumns = 4;

/// A ball of radius 0.45 on the floor, whose tangents run round it.
std::uint32_t add_ball(Scene& scene, const std::string& name, std::uint32_t material) {
  Mesh ball = shapes::cube_sphere(24);
  for (const glm::vec3& normal : ball.normals) {
    const glm::vec3 around = glm::cross(glm::vec3(0.0F, 1.0F, 0.0F), normal);
    const float length = glm::length(around);
    ball.tangents.emplace_back(length > 0.0F ? around / length : glm::vec3(0.0F), 1.0F);
  }
  return add_mesh(scene, std::move(ball), name, material);
}

/// The next place of the rows is filled by a ball.
void add_example(Scene& scene, Material material, const std::function<void(MaterialExtensions&)>& set) {
  MaterialExtensions extensions;
  set(extensions);
  material.extensions = std::make_shared<const MaterialExtensions>(extensions);
  const std::string name = material.name;
  const auto number = static_cast<int>(scene.instances.size()) - 1;
  const std::uint32_t mesh = add_ball(scene, name, add_material(scene, std::move(material)));
  const double x = number % kColumns - 0.5 * (kColumns - 1);
  const double z = number / kColumns - 0.5;
  add_instance(scene, mesh, shapes::placed({x, 0.45, 1.2 * z}, 0.45));
}

void fill_extensions(Scene& scene, const OptionReader& /*options*/) {
  scene.environment = make_studio();
  Mesh floor;
  shapes::add_quad(floor, {glm::dvec3(-3, 0, 2), glm::dvec3(3, 0, 2), glm::dvec3(3, 0, -2), glm::dvec3(-3, 0, -2)});
  add_single(scene, std::move(floor), "floor", add_material(scene, plastic("floor", glm::vec3(0.6F), 0.8F)));

  add_example(scene, plastic("specular", {0.6F, 0.05F, 0.04F}, 0.15F), [](MaterialExtensions& e) {
    e.specular_color = {0.2F, 1.0F, 6.0F};
  });
  add_example(scene, metal("clearcoat", {0.1F, 0.25F, 0.6F}, 0.5F), [](MaterialExtensions& e) { e.clearcoat = 1.0F; });
  add_example(scene, plastic("sheen", {0.15F, 0.02F, 0.05F}, 1.0F), [](MaterialExtensions& e) {
    e.sheen_color = {0.9F, 0.5F, 0.6F};
    e.sheen_roughness = 0.5F;
  });
  add_example(scene, metal("anisotropy", {0.9F, 0.8F, 0.6F}, 0.25F),
              [](MaterialExtensions& e) { e.anisotropy = 0.8F; });
  add_example(scene, plastic("iridescence", glm::vec3(0.02F), 0.1F), [](MaterialExtensions& e) {
    e.iridescence = 1.0F;
    e.iridescence_ior = 1.8F;
  });
  add_example(scene, glass("dispersion", 1.6F), [](MaterialExtensions& e) { e.dispersion = 4.0F; });
  Material wax = plastic("diffuse transmission", {0.8F, 0.75F, 0.6F}, 0.4F);
  wax.thickness = 1.0F;
  wax.attenuation_color = {0.9F, 0.5F, 0.2F};
  wax.attenuation_distance = 0.5F;
  add_example(scene, wax, [](MaterialExtensions& e) { e.diffuse_transmission = 0.8F; });
  add_example(scene, plastic("several", {0.02F, 0.2F, 0.05F}, 0.6F), [](MaterialExtensions& e) {
    e.clearcoat = 0.8F;
    e.clearcoat_roughness = 0.1F;
    e.sheen_color = glm::vec3(0.3F);
    e.sheen_roughness = 0.3F;
    e.iridescence = 0.5F;
  });

  add_camera(scene, "main", {0, 2.6, 5.2}, {0, 0.3, 0}, {0, 1, 0}, 34.0);
}

}  // namespace

Generator extensions_generator() {
  Generator generator;
  generator.name = "extensions";
  generator.summary = "a ball for each material extension, on a floor in a studio";
  return filled_by(std::move(generator), fill_extensions);
}

}  // namespace hpr
