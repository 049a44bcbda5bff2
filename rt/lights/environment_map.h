#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "scene/scene.h"

namespace hpr {

/// An environment as a light: bilinear between texel centres, sampled in proportion to its brightness. Texels are
/// chosen row by row (Pharr, Jakob, Humphreys, "Physically Based Rendering", 4th ed., section 12.5), then a direction
/// uniformly over the texel's solid angle, so that one texel, or a constant picture, gives exactly 1 / 4 pi.
class EnvironmentMap {
 public:
  /// The environment must outlive this, and have at least one pixel.
  explicit EnvironmentMap(const Environment& environment);

  struct DirectionalRadiance {
    glm::dvec3 radiance{0.0};
    double pdf = 0.0;  ///< of sample(), per solid angle; zero only where the radiance is
  };
  /// `direction` has unit length.
  [[nodiscard]] DirectionalRadiance evaluate(const glm::dvec3& direction) const;
  /// A direction of unit length. The environment must not be black.
  [[nodiscard]] glm::dvec3 sample(const glm::dvec2& u) const;

  /// Radiance, averaged over all directions.
  [[nodiscard]] const glm::dvec3& mean() const { return mean_; }

  /// Whether radiance is the same in all directions.
  [[nodiscard]] bool is_constant() const { return environment_->is_constant(); }

  /// Which fraction of a diffuse surface's samples is better spread by the cosine than by brightness: 1 for a constant
  /// picture, near 0 for one with a sun in it.
  [[nodiscard]] double cosine_fraction() const { return cosine_fraction_; }

 private:
  [[nodiscard]] glm::dvec3 texel(int x, int y) const;
  [[nodiscard]] glm::dvec3 texel_mean(int x, int y) const;

  const Environment* environment_;
  std::vector<double> row_cosines_;  ///< of the polar angles between rows: height + 1
  std::vector<double> row_sums_;     ///< of brightness times solid angle
  std::vector<double> texel_sums_;   ///< of brightness, starting anew in every row
  glm::dvec3 mean_{0.0};
  double cosine_fraction_ = 1.0;
};

}  // namespace hpr
