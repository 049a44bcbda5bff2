#pragma once

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <string>

#include "rt/materials/bsdf.h"

/// Surfaces in the plane z = 0, seen from above.
namespace hpr::test {

inline constexpr glm::dvec3 kUp(0.0, 0.0, 1.0);

inline glm::dvec3 direction(double polar, double around) {
  return {std::sin(polar) * std::cos(around), std::sin(polar) * std::sin(around), std::cos(polar)};
}

inline SurfacePoint seen_from(const glm::dvec3& viewer, bool inside = false) {
  SurfacePoint surface;
  surface.to_viewer = viewer;
  surface.geometric_normal = kUp;
  surface.shading_normal = kUp;
  surface.inside = inside;
  return surface;
}

inline Bsdf bsdf_of(const MaterialPoint& material, const glm::dvec3& viewer, bool inside = false,
                    Carried carried = Carried::Radiance) {
  return {material, seen_from(viewer, inside), carried};
}

inline MaterialPoint metal(double roughness, double reflectance) {
  MaterialPoint material;
  material.base_color = glm::dvec3(reflectance);
  material.metallic = 1.0;
  material.roughness = roughness;
  return material;
}

inline MaterialPoint dielectric(double roughness, double albedo, double ior = 1.5) {
  MaterialPoint material;
  material.base_color = glm::dvec3(albedo);
  material.roughness = roughness;
  material.ior = ior;
  return material;
}

inline MaterialPoint glass(double roughness, double ior = 1.5) {
  MaterialPoint material = dielectric(roughness, 1.0, ior);
  material.transmission = 1.0;
  material.solid = true;
  return material;
}

inline MaterialPoint sheet(double roughness, double ior = 1.5) {
  MaterialPoint material = glass(roughness, ior);
  material.solid = false;
  return material;
}

inline MaterialPoint extended(MaterialPoint material, const ExtensionPoint& extensions) {
  material.extensions = std::make_shared<const ExtensionPoint>(extensions);
  return material;
}

}  // namespace hpr::test
