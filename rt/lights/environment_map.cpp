#include "rt/lights/environment_map.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <span>

#include "core/error.h"
#include "rt/sampling/sampling.h"

namespace hpr {
namespace {

constexpr double kPi = std::numbers::pi;

/// Of the sky, at most.
constexpr Size kCells{24, 12};

double brightness(const glm::dvec3& radiance) {
  return (radiance.r + radiance.g + radiance.b) / 3.0;
}

}  // namespace

glm::dvec3 EnvironmentMap::texel(int x, int y) const {
  const Image<Rgb>& image = environment_->image;
  const Rgb& stored = image.at((x + image.width()) % image.width(), std::clamp(y, 0, image.height() - 1));
  return environment_->scale * glm::dvec3(stored.r, stored.g, stored.b);
}

/// Over the texel's square: what bilinear interpolation brings in from its neighbours included.
glm::dvec3 EnvironmentMap::texel_mean(int x, int y) const {
  const auto across = [&](int row) {
    return 0.125 * texel(x - 1, row) + 0.75 * texel(x, row) + 0.125 * texel(x + 1, row);
  };
  return 0.125 * across(y - 1) + 0.75 * across(y) + 0.125 * across(y + 1);
}

EnvironmentMap::Texels EnvironmentMap::columns_of(int cell) const {
  const int width = environment_->image.width();
  return {cell * width / cells_.width, (cell + 1) * width / cells_.width};
}

EnvironmentMap::Texels EnvironmentMap::rows_of(int cell) const {
  const int height = environment_->image.height();
  return {cell * height / cells_.height, (cell + 1) * height / cells_.height};
}

std::size_t EnvironmentMap::index_of(int x, int y) const {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(environment_->image.width()) +
         static_cast<std::size_t>(x);
}

double EnvironmentMap::solid_angle(int row) const {
  const auto at = static_cast<std::size_t>(row);
  return 2.0 * kPi * (row_cosines_[at] - row_cosines_[at + 1]) / environment_->image.width();
}

SkyCell EnvironmentMap::make_cell(int column, int row, std::span<const glm::dvec3> horizon, double& squares) {
  const Size size = environment_->image.size();
  const Texels columns = columns_of(column);
  const Texels rows = rows_of(row);
  const double latitude = 0.5 * (rows.first + rows.end) / size.height;
  SkyCell cell;
  cell.center = direction_at(0.5 * (columns.first + columns.end) / size.width, std::cos(kPi * latitude));
  // First along the center's circle of latitude, then along the meridian.
  const double around = kPi * (columns.end - columns.first) / size.width;
  cell.radius_radians = around * std::sin(kPi * latitude) + 0.5 * kPi * (rows.end - rows.first) / size.height;
  cell.cosine = std::cos(cell.radius_radians);
  cell.sine = std::sin(cell.radius_radians);
  for (int y = rows.first; y < rows.end; ++y) {
    const double polar = kPi * (y + 0.5) / size.height;
    glm::dvec3 radiance(0.0);
    glm::dvec3 flux(0.0);
    double in_row = 0.0;
    for (int x = columns.first; x < columns.end; ++x) {
      const glm::dvec3 texel = texel_mean(x, y);
      const double bright = brightness(texel);
      radiance += texel;
      flux += bright * horizon[static_cast<std::size_t>(x)];
      squares += solid_angle(y) * bright * bright;
      texel_sums_[index_of(x, y)] = in_row += bright;
    }
    mean_ += solid_angle(y) / (4.0 * kPi) * radiance;
    cell.flux += solid_angle(y) * (std::sin(polar) * flux + glm::dvec3(0.0, std::cos(polar) * in_row, 0.0));
    cell.power += in_row * solid_angle(y);
    row_sums_[static_cast<std::size_t>(column) * static_cast<std::size_t>(size.height) + static_cast<std::size_t>(y)] =
        cell.power;
  }
  return cell;
}

EnvironmentMap::EnvironmentMap(const Environment& environment) : environment_(&environment) {
  const Size size = environment.image.size();
  HPR_CHECK(size.area() > 0);
  if (is_constant()) {
    mean_ = texel(0, 0);
    return;
  }
  cells_ = {std::min(size.width, kCells.width), std::min(size.height, kCells.height)};
  for (int y = 0; y <= size.height; ++y) row_cosines_.push_back(std::cos(kPi * y / size.height));
  row_cosines_.back() = -1.0;
  std::vector<glm::dvec3> horizon;
  for (int x = 0; x < size.width; ++x) horizon.push_back(direction_at((x + 0.5) / size.width, 0.0));
  texel_sums_.resize(size.area());
  row_sums_.resize(static_cast<std::size_t>(cells_.width) * static_cast<std::size_t>(size.height));
  std::vector<SkyCell> cells;
  double squares = 0.0;
  for (int row = 0; row < cells_.height; ++row) {
    for (int column = 0; column < cells_.width; ++column) {
      cells.push_back(make_cell(column, row, horizon, squares));
      cell_powers_.push_back(cells.back().power);
    }
  }
  facing_ = FacingTables(cells, static_cast<std::size_t>(cells_.width));
  // About the relative variances of a sample of a matte surface under open sky. Each way has its share by how little
  // the other is good for.
  constexpr double kByCells = 0.1;
  const double power = std::accumulate(cell_powers_.begin(), cell_powers_.end(), 0.0);
  const double by_cosine = power > 0.0 ? std::max(0.0, 4.0 * kPi * squares / (power * power) - 1.0) : 0.0;
  cosine_fraction_ = kByCells / (kByCells + by_cosine);
}

EnvironmentMap::Position EnvironmentMap::position_of(const glm::dvec3& direction) const {
  const Size size = environment_->image.size();
  const double turn = 0.5 + (std::atan2(direction.x, -direction.z) + environment_->rotation_radians) / (2.0 * kPi);
  return {(turn - std::floor(turn)) * size.width, std::acos(std::clamp(direction.y, -1.0, 1.0)) / kPi * size.height};
}

glm::dvec3 EnvironmentMap::direction_at(double across_picture, double up) const {
  const double angle = 2.0 * kPi * (across_picture - 0.5) - environment_->rotation_radians;
  const double across = std::sqrt(std::max(0.0, (1.0 - up) * (1.0 + up)));
  return {across * std::sin(angle), up, -across * std::cos(angle)};
}

glm::dvec3 EnvironmentMap::between_texels(const Position& position) const {
  const int x0 = static_cast<int>(std::floor(position.x - 0.5));
  const int y0 = static_cast<int>(std::floor(position.y - 0.5));
  const double fx = position.x - 0.5 - x0;
  const double fy = position.y - 0.5 - y0;
  const auto between = [&](int y) { return (1.0 - fx) * texel(x0, y) + fx * texel(x0 + 1, y); };
  return (1.0 - fy) * between(y0) + fy * between(y0 + 1);
}

glm::dvec3 EnvironmentMap::radiance(const glm::dvec3& direction) const {
  return is_constant() ? mean_ : between_texels(position_of(direction));
}

EnvironmentMap::DirectionalRadiance EnvironmentMap::evaluate(const glm::dvec3& direction,
                                                             const glm::dvec3& normal) const {
  if (is_constant()) {
    if (!(brightness(mean_) > 0.0)) return {mean_, 0.0};
    const bool from_all_sides = normal == glm::dvec3(0.0);
    return {mean_, from_all_sides ? 0.25 / kPi : std::max(0.0, glm::dot(normal, direction)) / kPi};
  }
  const Size size = environment_->image.size();
  const Position position = position_of(direction);
  DirectionalRadiance seen{between_texels(position), 0.0};
  const int x = std::min(static_cast<int>(position.x), size.width - 1);
  const int y = std::min(static_cast<int>(position.y), size.height - 1);
  const int column = ((x + 1) * cells_.width - 1) / size.width;
  const int row = ((y + 1) * cells_.height - 1) / size.height;
  const auto cell = static_cast<std::size_t>(row * cells_.width + column);
  const bool from_all_sides = normal == glm::dvec3(0.0);
  const double by_cosine = from_all_sides ? 0.0 : cosine_fraction_;
  if (!from_all_sides) seen.pdf = by_cosine * std::max(0.0, glm::dot(normal, direction)) / kPi;
  if (!(cell_powers_[cell] > 0.0)) return seen;
  const std::size_t index = index_of(x, y);
  const double value = texel_sums_[index] - (x > columns_of(column).first ? texel_sums_[index - 1] : 0.0);
  // Of the cell the texel has its share of brightness times solid angle, and spreads it over that solid angle.
  seen.pdf += (1.0 - by_cosine) * (value / cell_powers_[cell]) *
              facing_.table(normal).probability(static_cast<std::size_t>(row), static_cast<std::size_t>(column));
  return seen;
}

double EnvironmentMap::irradiance(const glm::dvec3& normal) const {
  return is_constant() ? kPi * brightness(mean_) : facing_.table(normal).rows.back();
}

std::optional<glm::dvec3> EnvironmentMap::sample(const glm::dvec3& normal, double u_choice, const glm::dvec2& u) const {
  const bool from_all_sides = normal == glm::dvec3(0.0);
  if (from_all_sides && is_constant()) return direction_at(u.x, 1.0 - 2.0 * u.y);
  if (!from_all_sides && u_choice < cosine_fraction_) return warp::cosine_lobe(normal, u);
  return sample_cells(normal, u);
}

std::optional<glm::dvec3> EnvironmentMap::sample_cells(const glm::dvec3& normal, const glm::dvec2& u) const {
  const FacingTables::Table table = facing_.table(normal);
  if (!(table.rows.back() > 0.0)) return std::nullopt;
  const DiscreteSample row = sample_discrete(table.rows, u.y);
  const DiscreteSample column = sample_discrete(table.row(row.index), u.x);
  const Size size = environment_->image.size();
  const Texels rows = rows_of(static_cast<int>(row.index));
  const Texels columns = columns_of(static_cast<int>(column.index));
  const auto part = [](const std::vector<double>& sums, std::size_t first, const Texels& texels) {
    return std::span(sums).subspan(first + static_cast<std::size_t>(texels.first),
                                   static_cast<std::size_t>(texels.end - texels.first));
  };
  const DiscreteSample y =
      sample_discrete(part(row_sums_, column.index * static_cast<std::size_t>(size.height), rows), row.rest);
  const std::size_t found = static_cast<std::size_t>(rows.first) + y.index;
  const DiscreteSample x =
      sample_discrete(part(texel_sums_, index_of(0, static_cast<int>(found)), columns), column.rest);
  const double up = row_cosines_[found] + y.rest * (row_cosines_[found + 1] - row_cosines_[found]);
  return direction_at((columns.first + static_cast<double>(x.index) + x.rest) / size.width, up);
}

}  // namespace hpr
