#include "rt/materials/anisotropic_facets.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "rt/materials/microfacets.h"

namespace hpr {
namespace {

constexpr double square(double x) {
  return x * x;
}

}  // namespace

AnisotropicFacets::AnisotropicFacets(const glm::dvec3& view, const glm::dvec3& normal, const glm::dvec3& tangent,
                                     double along, double across)
    : frame_(tangent, glm::cross(normal, tangent), normal),
      view_(view * frame_),
      along_(along),
      across_(across),
      view_stretched_(stretched(view_)),
      bound_(mirrored_bound(std::min(view_.z, 1.0), square(std::min(along, across)))) {}

/// The length of a direction in coordinates where the facets are isotropic of roughness 1: Heitz 2014, section 5.4.
double AnisotropicFacets::stretched(const glm::dvec3& local) const {
  return std::sqrt(square(along_ * local.x) + square(across_ * local.y) + square(local.z));
}

double AnisotropicFacets::distribution(const glm::dvec3& half) const {
  const double spread = square(half.x / along_) + square(half.y / across_) + square(half.z);
  return 1.0 / (std::numbers::pi * along_ * across_ * spread * spread);
}

double AnisotropicFacets::value(const glm::dvec3& to_light) const {
  const glm::dvec3 light = to_light * frame_;
  const double facets = distribution(glm::normalize(view_ + light));
  return 0.5 * facets / (light.z * view_stretched_ + view_.z * stretched(light));
}

double AnisotropicFacets::pdf(const glm::dvec3& to_light) const {
  const glm::dvec3 light = to_light * frame_;
  return distribution(glm::normalize(view_ + light)) / (2.0 * (bound_ * view_.z + view_stretched_));
}

std::optional<glm::dvec3> AnisotropicFacets::sample(const glm::dvec2& u) const {
  const glm::dvec3 half = visible_normal(view_, {along_, across_}, bound_, u.x, warp::on_circle(u.y));
  const glm::dvec3 light = 2.0 * glm::dot(view_, half) * half - view_;
  if (!(light.z > 0.0)) return std::nullopt;
  return glm::normalize(frame_ * light);
}

}  // namespace hpr
