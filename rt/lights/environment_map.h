#pragma once

#include <cstddef>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "rt/lights/facing_tables.h"
#include "scene/scene.h"

namespace hpr {

/// An environment as a light: bilinear between texel centres, sampled in proportion to its brightness and to what a
/// surface takes from where it comes. First one of some hundred cells is chosen (FacingTables), then a texel of it by
/// brightness (Pharr, Jakob, Humphreys, "Physically Based Rendering", 4th ed., section 12.5), then a direction
/// uniformly over the texel's solid angle. Even pictures are rather sampled by the
/// cosine alone, a constant one always, which has the density of the sphere where light comes from all sides.
class EnvironmentMap {
 public:
  /// The environment must outlive this, and have at least one pixel.
  explicit EnvironmentMap(const Environment& environment);

  struct DirectionalRadiance {
    glm::dvec3 radiance{0.0};
    double pdf = 0.0;  ///< of sample(), per solid angle; above zero where both radiance and cosine are
  };
  /// `direction` has unit length. `normal`, of the surface that is lit, has unit length or is zero: light from all
  /// sides.
  [[nodiscard]] DirectionalRadiance evaluate(const glm::dvec3& direction, const glm::dvec3& normal) const;
  [[nodiscard]] glm::dvec3 radiance(const glm::dvec3& direction) const;
  /// A direction of unit length; none where no light comes to that side.
  [[nodiscard]] std::optional<glm::dvec3> sample(const glm::dvec3& normal, double u_choice, const glm::dvec2& u) const;

  /// Radiance, averaged over all directions.
  [[nodiscard]] const glm::dvec3& mean() const { return mean_; }

  /// An upper estimate of the irradiance under open sky, mean of the channels, in W/m^2. `normal`: unit length.
  [[nodiscard]] double irradiance(const glm::dvec3& normal) const;

  /// Whether radiance is the same in all directions.
  [[nodiscard]] bool is_constant() const { return environment_->is_constant(); }

  // What it samples by, as devices have it. Tables of a constant one are empty.
  [[nodiscard]] const Environment& environment() const { return *environment_; }
  [[nodiscard]] Size cells() const { return cells_; }
  [[nodiscard]] const FacingTables& facing() const { return facing_; }
  [[nodiscard]] std::span<const double> row_cosines() const { return row_cosines_; }
  [[nodiscard]] std::span<const double> row_sums() const { return row_sums_; }
  [[nodiscard]] std::span<const double> texel_sums() const { return texel_sums_; }
  [[nodiscard]] std::span<const double> cell_powers() const { return cell_powers_; }
  [[nodiscard]] double cosine_fraction() const { return cosine_fraction_; }

 private:
  /// A position of the picture, in texels.
  struct Position {
    double x = 0.0;
    double y = 0.0;
  };
  /// Columns or rows of texels.
  struct Texels {
    int first = 0;
    int end = 0;
  };

  [[nodiscard]] Position position_of(const glm::dvec3& direction) const;
  /// `across_picture` in [0, 1), from its left; `up`: the cosine of the polar angle.
  [[nodiscard]] glm::dvec3 direction_at(double across_picture, double up) const;
  [[nodiscard]] glm::dvec3 texel(int x, int y) const;
  [[nodiscard]] glm::dvec3 texel_mean(int x, int y) const;
  [[nodiscard]] glm::dvec3 between_texels(const Position& position) const;
  [[nodiscard]] Texels columns_of(int cell) const;
  [[nodiscard]] Texels rows_of(int cell) const;
  [[nodiscard]] std::optional<glm::dvec3> sample_cells(const glm::dvec3& normal, const glm::dvec2& u) const;
  /// `horizon`: the direction of each column there. Adds to the squares of brightness, over solid angles.
  [[nodiscard]] SkyCell make_cell(int column, int row, std::span<const glm::dvec3> horizon, double& squares);
  [[nodiscard]] std::size_t index_of(int x, int y) const;
  /// The texel's solid angle.
  [[nodiscard]] double solid_angle(int row) const;

  const Environment* environment_;
  Size cells_;
  FacingTables facing_;
  std::vector<double> row_cosines_;  ///< of the polar angles between rows: height + 1
  std::vector<double> row_sums_;     ///< of brightness times solid angle, column of cells by column, anew in every cell
  std::vector<double> texel_sums_;   ///< of brightness, row by row, starting anew in every cell
  std::vector<double> cell_powers_;  ///< row by row
  glm::dvec3 mean_{0.0};
  double cosine_fraction_ = 1.0;  ///< of a surface's samples that are spread by the cosine
};

}  // namespace hpr
