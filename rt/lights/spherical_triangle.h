#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

namespace hpr {

/// A triangle seen from a place, as a part of the unit sphere. Arvo, "Stratified Sampling of Spherical Triangles",
/// SIGGRAPH 1995; the solid angle by Van Oosterom and Strackee, "The Solid Angle of a Plane Triangle", 1983. Products
/// stand where the papers have differences of nearly equal numbers, so small triangles keep their digits.
class SphericalTriangle {
 public:
  /// The triangle v0, v0 + e1, v0 + e2.
  SphericalTriangle(const glm::dvec3& place, const glm::dvec3& v0, const glm::dvec3& e1, const glm::dvec3& e2);

  [[nodiscard]] double solid_angle() const { return solid_angle_; }
  /// Whether sample() is accurate: not below 1e-6 sr, nor for a triangle that is all but an arc or half the sphere.
  [[nodiscard]] bool can_sample() const;
  /// A direction of unit length, uniform over the solid angle; needs can_sample().
  [[nodiscard]] glm::dvec3 sample(const glm::dvec2& u) const;

 private:
  glm::dvec3 a_{0.0};  ///< unit length, to the corners
  glm::dvec3 b_{0.0};
  glm::dvec3 c_{0.0};
  double solid_angle_ = 0.0;
  double alpha_ = 0.0;      ///< the inner angle at a
  double below_cos_c_ = 0;  ///< 1 - cos of the arc from a to b
};

}  // namespace hpr
