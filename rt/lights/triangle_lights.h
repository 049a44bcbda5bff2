#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "rt/lights/light_tree.h"
#include "rt/lights/punctual_light.h"
#include "rt/trace/surfaces.h"
#include "scene/scene.h"

namespace hpr {

/// A triangle seen from a place, as a part of the unit sphere. Arvo, "Stratified Sampling of Spherical Triangles",
/// SIGGRAPH 1995; the solid angle by Van Oosterom and Strackee, "The Solid Angle of a Plane Triangle", 1983. Products
/// stand where the papers have differences of nearly equal numbers, so small triangles keep their digits.
class SphericalTriangle {
 public:
  /// The triangle v0, v0 + e1, v0 + e2.
  SphericalTriangle(const glm::dvec3& position, const glm::dvec3& v0, const glm::dvec3& e1, const glm::dvec3& e2);

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

/// A triangle of the scene that emits, from the sides that its material shows.
struct TriangleLight {
  glm::dvec3 v0{0.0};
  glm::dvec3 e1{0.0};
  glm::dvec3 e2{0.0};
  glm::dvec3 normal{0.0};   ///< unit length; of one that emits from its front alone, on that side
  double area = 0.0;        ///< m^2
  double offset = 0.0;      ///< metres by which ray origins must leave it
  glm::dvec3 mean{0.0};     ///< radiance over its area; an estimate where it is textured
  double brightness = 0.0;  ///< what it is chosen by: above zero wherever it may emit
  std::uint32_t surface = 0;
  std::uint32_t instance = 0;
  std::uint32_t index = 0;  ///< in the instance's mesh
  bool two_sided = true;
  bool is_coated = false;  ///< emits less the more it is looked at aslant

  /// Whether a place lies where it emits to.
  [[nodiscard]] bool shines_on(const glm::dvec3& position) const {
    return two_sided || glm::dot(position - v0, normal) > 0.0;
  }
  [[nodiscard]] double sides() const { return two_sided ? 2.0 : 1.0; }
};

/// Every triangle that emits, sampled by the solid angle it is seen under (Arvo, "Stratified Sampling of Spherical
/// Triangles", 1995), or by its area when that is below 1e-6 sr or the spherical triangle all but degenerate.
class TriangleLights {
 public:
  /// The scene must outlive this. Triangles without area, and those a texture leaves black, are left out.
  explicit TriangleLights(const Scene& scene);

  [[nodiscard]] std::size_t size() const { return triangles_.size(); }
  [[nodiscard]] const TriangleLight& operator[](std::size_t triangle) const { return triangles_[triangle]; }
  /// The triangle with this surface id, if it emits. O(log n).
  [[nodiscard]] std::optional<std::size_t> find(std::uint32_t surface) const;

  [[nodiscard]] LightSample sample(std::size_t triangle, const glm::dvec3& position, const glm::dvec2& u) const;
  /// Per solid angle: the density with which sample() picks the direction to `point` of the triangle.
  [[nodiscard]] double pdf(std::size_t triangle, const glm::dvec3& position, const glm::dvec3& point) const;

  /// A photon, uniform over area and with a cosine lobe; of two sides, from the front for `u_side` below a half. The
  /// mean of its flux is the triangle's power, where no coat dims it.
  [[nodiscard]] PhotonStart emit(std::size_t triangle, double u_side, const glm::dvec2& u_place,
                                 const glm::dvec2& u_direction) const;
  /// Watts of all sides it emits from, before a coat dims any.
  [[nodiscard]] glm::dvec3 power(std::size_t triangle) const;
  [[nodiscard]] LightBounds bounds(std::size_t triangle) const;

 private:
  [[nodiscard]] glm::dvec3 radiance(const TriangleLight& triangle, const glm::dvec2& at) const;
  [[nodiscard]] glm::dvec3 radiance_along(const TriangleLight& triangle, const glm::dvec2& at,
                                          const glm::dvec3& position, const glm::dvec3& direction) const;
  void estimate_brightness(TriangleLight& triangle) const;

  const Scene* scene_;
  std::vector<TriangleLight> triangles_;    ///< by surface id
  std::unique_ptr<const Surfaces> coated_;  ///< null where none is coated
};

}  // namespace hpr
