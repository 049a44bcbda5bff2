#pragma once

#include <array>
#include <cstddef>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

namespace hpr {

/// A part of all directions, and the light that comes from there.
struct SkyCell {
  glm::dvec3 center{0.0};       ///< unit length
  double radius_radians = 0.0;  ///< no direction of the cell lies farther from the center
  double cosine = 1.0;          ///< of the radius
  double sine = 0.0;
  double power = 0.0;    ///< brightness times solid angle
  glm::dvec3 flux{0.0};  ///< directions, weighed by brightness, times solid angle: what a surface takes of it
};

/// How much a surface takes from each cell of the sky by how it is turned, for choosing cells: brightness times cosine
/// (Clarberg et al., "Wavelet Importance Sampling: Efficiently Evaluating Products of Complex Functions", 2005, have
/// such tables of products). Normals are rounded to 384 directions; no cell that a normal sees any of is left out.
class FacingTables {
 public:
  FacingTables() = default;
  /// `cells`: rows of equal length, one after the other.
  FacingTables(std::span<const SkyCell> cells, std::size_t columns);

  /// Of a normal of unit length, or of all directions alike where it is zero.
  struct Table {
    std::span<const double> rows;   ///< running sums of what comes from each row
    std::span<const double> cells;  ///< of each row: running sums of what comes from its cells

    /// The row's part of `cells`.
    [[nodiscard]] std::span<const double> row(std::size_t row) const;
    /// With what probability a cell is chosen in proportion to these sums.
    [[nodiscard]] double probability(std::size_t row, std::size_t column) const;
  };
  [[nodiscard]] Table table(const glm::dvec3& normal) const;

  /// Table after table, rows before cells: those of the 384 directions, then that of all directions alike.
  [[nodiscard]] std::span<const double> sums() const { return sums_; }

 private:
  std::size_t rows_ = 0;
  std::size_t columns_ = 0;
  std::vector<double> sums_;  ///< table after table: rows, then cells
};

}  // namespace hpr
