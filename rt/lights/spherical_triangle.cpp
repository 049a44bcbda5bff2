#include "rt/lights/spherical_triangle.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace hpr {
namespace {

constexpr double kLeastSolidAngle = 1e-6;
constexpr double kLeastSine = 1e-4;

/// The part of `v` that is perpendicular to `axis`, at unit length.
glm::dvec3 perpendicular(const glm::dvec3& v, const glm::dvec3& axis) {
  return glm::normalize(v - glm::dot(v, axis) * axis);
}

}  // namespace

SphericalTriangle::SphericalTriangle(const glm::dvec3& place, const glm::dvec3& v0, const glm::dvec3& e1,
                                     const glm::dvec3& e2) {
  const glm::dvec3 to_a = v0 - place;
  const glm::dvec3 to_b = to_a + e1;
  const glm::dvec3 to_c = to_a + e2;
  const double la = glm::length(to_a);
  const double lb = glm::length(to_b);
  const double lc = glm::length(to_c);
  const double product = la * lb * lc;
  if (!(product > 0.0) || !std::isfinite(product)) return;
  a_ = to_a / la;
  b_ = to_b / lb;
  c_ = to_c / lc;
  const double determinant = std::abs(glm::dot(to_a, glm::cross(e1, e2))) / product;
  const double sum = 1.0 + glm::dot(a_, b_) + glm::dot(b_, c_) + glm::dot(c_, a_);
  solid_angle_ = 2.0 * std::atan2(determinant, sum);
  const glm::dvec3 normal_ab = glm::cross(to_a, e1);
  const glm::dvec3 normal_ac = glm::cross(to_a, e2);
  alpha_ = std::atan2(glm::length(glm::cross(normal_ab, normal_ac)), glm::dot(normal_ab, normal_ac));
  const double sine2 = glm::dot(normal_ab, normal_ab) / (la * la * lb * lb);
  const double cosine = glm::dot(a_, b_);
  below_cos_c_ = cosine > 0.0 ? sine2 / (1.0 + cosine) : 1.0 - cosine;
}

bool SphericalTriangle::can_sample() const {
  return solid_angle_ >= kLeastSolidAngle && std::sin(alpha_) > kLeastSine && below_cos_c_ < 2.0 - 1e-6;
}

glm::dvec3 SphericalTriangle::sample(const glm::dvec2& u) const {
  // A smaller triangle with the share u.x of the area, cut off by the arc from b to a point d on the arc from a to c.
  const double s = u.x * solid_angle_;
  const double sin_alpha = std::sin(alpha_);
  const double cos_alpha = std::cos(alpha_);
  const double sin_phi = std::sin(alpha_ - s);
  const double cos_phi = -std::cos(alpha_ - s);
  const double half = std::sin(0.5 * s);
  const double k1 = -2.0 * std::sin(alpha_ - 0.5 * s) * half;  // cos alpha + cos phi
  const double k2 = -2.0 * std::cos(alpha_ - 0.5 * s) * half + sin_alpha * below_cos_c_;
  const double cos_ad = std::clamp(
      (k2 + (k2 * cos_phi - k1 * sin_phi) * cos_alpha) / ((k2 * sin_phi + k1 * cos_phi) * sin_alpha), -1.0, 1.0);
  const glm::dvec3 d = cos_ad * a_ + std::sqrt((1.0 - cos_ad) * (1.0 + cos_ad)) * perpendicular(c_, a_);
  // A point of the arc from b to d, uniform in the cosine.
  const double bd = glm::length(d - b_);
  const double below = u.y * 0.5 * bd * bd;  // 1 - cos
  if (!(below > 0.0)) return b_;
  const double across = std::sqrt(below * (2.0 - below));
  return glm::normalize((1.0 - below) * b_ + across * perpendicular(d, b_));
}

}  // namespace hpr
