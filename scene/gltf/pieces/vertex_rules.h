#pragma once

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

/// What becomes of one vertex's values as a glTF file has them, whether its mesh is read whole or in pieces.
namespace hpr {

/// Brings a texture coordinate into what samplers can turn into integers; 1e6 repeats of a texture are already below
/// what a float resolves. Returns whether it was outside.
[[nodiscard]] inline bool tame_uv(glm::vec2& uv) {
  constexpr float kMaxTexcoord = 1e6F;
  bool odd = false;
  for (int axis = 0; axis < 2; ++axis) {
    if (std::abs(uv[axis]) <= kMaxTexcoord) continue;
    uv[axis] = std::isfinite(uv[axis]) ? std::copysign(kMaxTexcoord, uv[axis]) : 0.0F;
    odd = true;
  }
  return odd;
}

/// Brings a color into 0 to 1. Returns whether it was outside.
[[nodiscard]] inline bool tame_color(glm::vec4& color) {
  bool odd = false;
  for (int c = 0; c < 4; ++c) {
    if (color[c] >= 0.0F && color[c] <= 1.0F) continue;
    color[c] = std::isnan(color[c]) ? 1.0F : std::clamp(color[c], 0.0F, 1.0F);
    odd = true;
  }
  return odd;
}

enum class NormalLength { One, Other, None };

/// Makes a normal a unit vector, if it has a direction. One that was a unit vector but for rounding keeps its bits.
/// Returns what it was; up to a tenth off counts as one.
[[nodiscard]] inline NormalLength repair_normal(glm::vec3& normal) {
  const glm::dvec3 exact(normal);
  const double square = glm::dot(exact, exact);
  if (std::abs(square - 1.0) < 1e-6) return NormalLength::One;
  if (!(square > 0.0) || !std::isfinite(square)) return NormalLength::None;
  normal = glm::vec3(exact / std::sqrt(square));
  return std::abs(square - 1.0) > 0.2 ? NormalLength::Other : NormalLength::One;
}

/// Makes a tangent a unit vector with a sign of 1 or -1, or zero where it has no direction. One that was a unit vector
/// but for rounding keeps its bits. Returns whether it was none.
[[nodiscard]] inline bool repair_tangent(glm::vec4& tangent) {
  const glm::dvec3 along(tangent);
  const double square = glm::dot(along, along);
  const float sign = tangent.w < 0.0F ? -1.0F : 1.0F;
  const bool odd = !(std::abs(square - 1.0) < 0.2) || tangent.w != sign;
  tangent.w = sign;
  if (std::abs(square - 1.0) < 1e-6) return odd;
  const bool directed = square > 0.0 && std::isfinite(square);
  tangent = glm::vec4(directed ? glm::vec3(along / std::sqrt(square)) : glm::vec3(0.0F), sign);
  return odd;
}

/// The unit normal of a triangle; any direction where it has no area.
[[nodiscard]] inline glm::vec3 flat_normal(const glm::vec3& a, const glm::vec3& b, const glm::vec3& c) {
  const glm::dvec3 v0(a);
  const glm::dvec3 cross = glm::cross(glm::dvec3(b) - v0, glm::dvec3(c) - v0);
  const double length = glm::length(cross);
  return length > 0.0 && std::isfinite(length) ? glm::vec3(cross / length) : glm::vec3(0.0F, 0.0F, 1.0F);
}

}  // namespace hpr
