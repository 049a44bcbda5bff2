#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <numbers>
#include <span>

namespace hpr {

struct DiscreteSample {
  std::size_t index = 0;
  double probability = 0.0;
  double rest = 0.0;  ///< what is left of the random number, again uniform in [0, 1)
};

/// Chooses i with a probability in proportion to sums[i] - sums[i - 1]. `sums` never falls and ends above 0; what has
/// no share is never chosen. O(log n).
[[nodiscard]] inline DiscreteSample sample_discrete(std::span<const double> sums, double u) {
  constexpr double kBelowOne = 1.0 - 1.0 / 9007199254740992.0;
  const double target = std::min(u, kBelowOne) * sums.back();
  // The product may round up to the whole sum: then the last one with a share.
  auto found = std::ranges::upper_bound(sums, target);
  if (found == sums.end()) found = std::ranges::lower_bound(sums, sums.back());
  const double before = found == sums.begin() ? 0.0 : *(found - 1);
  const double weight = *found - before;
  return {static_cast<std::size_t>(found - sums.begin()), weight / sums.back(),
          std::clamp((target - before) / weight, 0.0, kBelowOne)};
}

}  // namespace hpr

/// Random numbers of the unit square made into directions and places, each uniformly unless it says otherwise.
namespace hpr::warp {

/// Columns x, y, z = `axis`, which has unit length; right-handed. Duff, Burgess, Christensen et al., "Building an
/// Orthonormal Basis, Revisited", JCGT 2017.
[[nodiscard]] inline glm::dmat3 basis_about(const glm::dvec3& axis) {
  const double sign = std::copysign(1.0, axis.z);
  const double a = -1.0 / (sign + axis.z);
  const double b = axis.x * axis.y * a;
  return {{1.0 + sign * axis.x * axis.x * a, sign * b, -sign * axis.x}, {b, sign + axis.y * axis.y * a, -axis.y}, axis};
}

[[nodiscard]] inline glm::dvec2 on_circle(double u) {
  const double angle = 2.0 * std::numbers::pi * u;
  return {std::cos(angle), std::sin(angle)};
}

[[nodiscard]] inline glm::dvec2 in_disc(const glm::dvec2& u) {
  return std::sqrt(u.x) * on_circle(u.y);
}

[[nodiscard]] inline glm::dvec3 on_sphere(const glm::dvec2& u) {
  return {2.0 * std::sqrt(u.x * (1.0 - u.x)) * on_circle(u.y), 1.0 - 2.0 * u.x};
}

/// Within a cone about `axis`; `opening` is 1 - cos of its half angle, which for narrow cones is known better than the
/// cosine.
[[nodiscard]] inline glm::dvec3 in_cone(const glm::dvec3& axis, double opening, const glm::dvec2& u) {
  const double below = opening * u.x;  // 1 - cos of the direction
  const glm::dvec2 across = std::sqrt(below * (2.0 - below)) * on_circle(u.y);
  return glm::normalize(basis_about(axis) * glm::dvec3(across, 1.0 - below));
}

/// On the side of `normal`, with the density cos / pi.
[[nodiscard]] inline glm::dvec3 cosine_lobe(const glm::dvec3& normal, const glm::dvec2& u) {
  const glm::dvec2 across = in_disc(u);
  return glm::normalize(basis_about(normal) * glm::dvec3(across, std::sqrt(std::max(0.0, 1.0 - u.x))));
}

}  // namespace hpr::warp
