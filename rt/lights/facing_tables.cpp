#include "rt/lights/facing_tables.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numbers>

namespace hpr {
namespace {

/// A cube about the directions, its faces cut into kSide x kSide squares.
constexpr std::size_t kSide = 8;
constexpr std::size_t kNormals = 6 * kSide * kSide;

/// Of a cell that may lie below the horizon as seen from the rounded normal: what the least of its weight is, relative
/// to the most that it may give. Smaller ones make bright cells at the horizon noisy, larger ones all others.
constexpr double kCaution = 0.25;

std::size_t square_of(double coordinate) {
  return std::min(static_cast<std::size_t>((0.5 + 0.5 * coordinate) * kSide), kSide - 1);
}

std::size_t index_of(const glm::dvec3& normal) {
  const glm::dvec3 size = glm::abs(normal);
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : (size.y >= size.z ? 1 : 2);
  const std::size_t face = 2 * static_cast<std::size_t>(axis) + (normal[axis] < 0.0 ? 1 : 0);
  const std::size_t across = square_of(normal[(axis + 1) % 3] / size[axis]);
  const std::size_t along = square_of(normal[(axis + 2) % 3] / size[axis]);
  return (face * kSide + along) * kSide + across;
}

/// Normals that are rounded to one.
struct Cone {
  glm::dvec3 axis{0.0};
  double radius_radians = 0.0;
  double cosine = 1.0;  ///< of the radius
  double sine = 0.0;
};

Cone normals_at(std::size_t index) {
  const auto axis = static_cast<int>(index / (2 * kSide * kSide));
  const double sign = index / (kSide * kSide) % 2 == 0 ? 1.0 : -1.0;
  const auto direction = [&](double across, double along) {
    glm::dvec3 to(0.0);
    to[axis] = sign;
    to[(axis + 1) % 3] = 2.0 / kSide * across - 1.0;
    to[(axis + 2) % 3] = 2.0 / kSide * along - 1.0;
    return glm::normalize(to);
  };
  const auto across = static_cast<double>(index % kSide);
  const auto along = static_cast<double>(index / kSide % kSide);
  Cone cone{direction(across + 0.5, along + 0.5)};
  for (const glm::dvec2 corner : {glm::dvec2(0, 0), {1, 0}, {0, 1}, {1, 1}}) {
    const double cosine = glm::dot(cone.axis, direction(across + corner.x, along + corner.y));
    cone.radius_radians = std::max(cone.radius_radians, std::acos(std::min(cosine, 1.0)));
  }
  cone.cosine = std::cos(cone.radius_radians);
  cone.sine = std::sin(cone.radius_radians);
  return cone;
}

/// The largest cosine between a normal and a direction of a cell, whose centers have that cosine.
double cosine_within(double cosine, const Cone& normals, const SkyCell& cell) {
  if (normals.radius_radians + cell.radius_radians >= std::numbers::pi) return 1.0;
  const double reach_cosine = normals.cosine * cell.cosine - normals.sine * cell.sine;
  if (cosine >= reach_cosine) return 1.0;
  const double reach_sine = normals.sine * cell.cosine + normals.cosine * cell.sine;
  return cosine * reach_cosine + std::sqrt(std::max(0.0, 1.0 - cosine * cosine)) * reach_sine;
}

}  // namespace

std::span<const double> FacingTables::Table::row(std::size_t row) const {
  const std::size_t columns = cells.size() / rows.size();
  return cells.subspan(row * columns, columns);
}

double FacingTables::Table::probability(std::size_t row, std::size_t column) const {
  const std::span<const double> in_row = this->row(row);
  if (!(rows.back() > 0.0) || !(in_row.back() > 0.0)) return 0.0;
  const double of_row = rows[row] - (row > 0 ? rows[row - 1] : 0.0);
  const double of_cell = in_row[column] - (column > 0 ? in_row[column - 1] : 0.0);
  return of_row / rows.back() * (of_cell / in_row.back());
}

FacingTables::FacingTables(std::span<const SkyCell> cells, std::size_t columns)
    : rows_(cells.size() / columns), columns_(columns), sums_((kNormals + 1) * (rows_ + cells.size())) {
  auto out = sums_.begin();
  const auto add_table = [&](const auto& weight_of) {
    const auto rows = out;
    out += static_cast<std::ptrdiff_t>(rows_);
    double sum = 0.0;
    for (std::size_t row = 0; row < rows_; ++row) {
      double in_row = 0.0;
      for (const SkyCell& cell : cells.subspan(row * columns_, columns_)) *out++ = in_row += weight_of(cell);
      rows[static_cast<std::ptrdiff_t>(row)] = sum += in_row;
    }
  };
  for (std::size_t i = 0; i < kNormals; ++i) {
    const Cone normals = normals_at(i);
    add_table([&](const SkyCell& cell) {
      if (!(cell.power > 0.0)) return 0.0;
      const double nearest = cosine_within(glm::dot(normals.axis, cell.center), normals, cell);
      return std::max(0.0, glm::dot(normals.axis, cell.flux)) + kCaution * cell.power * std::max(0.0, nearest);
    });
  }
  add_table([](const SkyCell& cell) { return cell.power; });
}

FacingTables::Table FacingTables::table(const glm::dvec3& normal) const {
  const std::size_t index = normal == glm::dvec3(0.0) ? kNormals : index_of(normal);
  const std::size_t cells = rows_ * columns_;
  const std::span<const double> sums = std::span(sums_).subspan(index * (rows_ + cells), rows_ + cells);
  return {sums.first(rows_), sums.last(cells)};
}

}  // namespace hpr
