#include "rt/materials/medium.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <map>
#include <span>

#include "scene/scene.h"

namespace hpr {
namespace {

/// The line that is followed both ways: along no axis, so that it seldom meets an edge.
constexpr glm::dvec3 kLine{0.31830988618, 0.91596559417, 0.24404084512};

bool is_solid(const Material& material) {
  const bool diffuse = material.extensions && material.extensions->diffuse_transmission > 0.0F;
  return (material.transmission > 0.0F || diffuse) && material.thickness > 0.0F && !material.unlit;
}

bool is_absorber(const Material& material) {
  return is_solid(material) && std::isfinite(material.attenuation_distance) &&
         material.attenuation_color != glm::vec3(1.0F);
}

bool meets_line(const Bounds& box, const glm::dvec3& position) {
  double first = -std::numeric_limits<double>::infinity();
  double last = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    first = std::max(first, (box.low[axis] - position[axis]) / kLine[axis]);
    last = std::min(last, (box.high[axis] - position[axis]) / kLine[axis]);
  }
  return first <= last;
}

/// The materials left in this order that were not entered on the way, the nearest first.
template <typename Crossings>
std::vector<std::uint32_t> left_unentered(const Crossings& crossings, bool leaving) {
  std::vector<std::uint32_t> left;
  std::map<std::uint32_t, int> entered;
  for (const auto& crossing : crossings) {
    int& open = entered[crossing.material];
    if (crossing.leaves != leaving) {
      ++open;
    } else if (open > 0) {
      --open;
    } else {
      left.push_back(crossing.material);
    }
  }
  return left;
}

}  // namespace

glm::dvec3 transmittance_to_light(const Media& media, const SurfacePoint& point, const MaterialPoint& material,
                                  const glm::dvec3& to_light, double metres) {
  if (!std::isfinite(metres)) return glm::dvec3(1.0);
  return transmittance(media_towards(media, point, material, to_light).here, metres);
}

MediumFinder::MediumFinder(const Scene& scene) : scene_(scene) {
  if (std::ranges::none_of(scene.materials, is_absorber)) return;
  std::map<std::uint32_t, Bounds> of_mesh;
  std::map<std::uint32_t, Bounds> of_material;
  for (std::uint32_t i = 0; i < scene.instances.size(); ++i) {
    const Instance& instance = scene.instances[i];
    const Mesh& mesh = scene.mesh_of(instance);
    const Material& material = scene.materials[mesh.material];
    // What is flat beyond measure bounds nothing.
    const glm::dmat4 from_world = glm::inverse(instance.to_world);
    if (!is_solid(material) || mesh.triangles.empty() || !std::isfinite(from_world[0][0])) continue;
    if (!of_mesh.contains(instance.mesh)) of_mesh.emplace(instance.mesh, mesh_bounds(mesh));
    const Solid& solid =
        solids_.emplace_back(Solid{i, transformed(instance.to_world, of_mesh.at(instance.mesh)), from_world});
    if (!is_absorber(material)) continue;
    Bounds& box = of_material.try_emplace(mesh.material, solid.box).first->second;
    box = united(box, solid.box);
  }
  for (const auto& [material, box] : of_material) boxes_.push_back(box);
}

/// Moeller and Trumbore 1997, in the mesh's own coordinates: a line keeps its parameter there.
void MediumFinder::cross(const Solid& solid, const glm::dvec3& position, std::vector<Crossing>& crossings) const {
  const Mesh& mesh = scene_.mesh_of(scene_.instances[solid.instance]);
  const glm::dvec3 origin(solid.from_world * glm::dvec4(position, 1.0));
  const glm::dvec3 direction(solid.from_world * glm::dvec4(kLine, 0.0));
  for (const glm::uvec3& corners : mesh.triangles) {
    const glm::dvec3 v0(mesh.positions[corners.x]);
    const glm::dvec3 e1 = glm::dvec3(mesh.positions[corners.y]) - v0;
    const glm::dvec3 e2 = glm::dvec3(mesh.positions[corners.z]) - v0;
    const glm::dvec3 p = glm::cross(direction, e2);
    const double determinant = glm::dot(e1, p);
    const glm::dvec3 from_v0 = origin - v0;
    const double u = glm::dot(from_v0, p) / determinant;
    if (!(u >= 0.0 && u <= 1.0)) continue;
    const glm::dvec3 q = glm::cross(from_v0, e1);
    const double v = glm::dot(direction, q) / determinant;
    if (!(v >= 0.0 && u + v <= 1.0)) continue;
    // The determinant is minus the product of the direction and the normal that the winding gives.
    crossings.push_back({glm::dot(e2, q) / determinant, mesh.material, determinant < 0.0});
  }
}

Media MediumFinder::at(const glm::dvec3& position) const {
  const auto holds = [&](const Bounds& box) {
    return glm::all(glm::lessThanEqual(box.low, position)) && glm::all(glm::lessThanEqual(position, box.high));
  };
  if (std::ranges::none_of(boxes_, holds)) return {};
  std::vector<Crossing> crossings;
  for (const Solid& solid : solids_) {
    if (meets_line(solid.box, position)) cross(solid, position, crossings);
  }
  std::ranges::stable_sort(crossings, {}, &Crossing::along);
  const auto here = std::ranges::lower_bound(crossings, 0.0, {}, &Crossing::along);
  const std::vector<std::uint32_t> up = left_unentered(std::span(here, crossings.end()), true);
  // Down the line, what leaves goes in and what enters goes out.
  std::ranges::reverse(crossings.begin(), here);
  std::vector<std::uint32_t> down = left_unentered(std::span(crossings.begin(), here), false);
  std::vector<glm::dvec3> found;
  for (const std::uint32_t material : up) {
    const auto both = std::ranges::find(down, material);
    if (both == down.end()) continue;
    down.erase(both);
    found.push_back(absorption_of(scene_.materials[material]));
  }
  found.resize(std::max<std::size_t>(found.size(), 2), glm::dvec3(0.0));
  return {found[0], found[1]};
}

std::vector<Media> MediumFinder::of_eyes(std::span<const View> views) const {
  std::vector<Media> media;
  for (const View& view : views) {
    const auto same = [&](const View& other) {
      return other.eye == view.eye && other.orthographic == view.orthographic;
    };
    const auto before = views.first(media.size());
    const auto known = static_cast<std::size_t>(std::ranges::find_if(before, same) - before.begin());
    const bool found = known < media.size();
    const Media own = found ? media[known] : view.orthographic ? Media{} : at(view.eye);
    media.push_back(own);
  }
  return media;
}

}  // namespace hpr
