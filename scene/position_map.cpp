#include "scene/position_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "core/error.h"
#include "scene/scene.h"

namespace hpr {
namespace {

constexpr int kBlockSide = 16;
/// The tangent of 85 degrees.
constexpr double kMaxTangent = 11.430052302761343;

/// A position between two neighbours: `part` of the distance from the first to the second.
struct Between {
  int first = 0;
  double part = 0.0;
};

Between between(double position, int count) {
  // A pixel's centre must not need a neighbour because of rounding.
  constexpr double kSame = 1e-6;
  if (count == 1) return {};
  double cell = position * count - 0.5;
  if (std::abs(cell - std::round(cell)) < kSame) cell = std::round(cell);
  const int first = static_cast<int>(std::clamp(std::floor(cell), 0.0, static_cast<double>(count - 2)));
  return {first, cell - first};
}

/// The centers of cells first to end of `count`, and the edges of the screen beside them.
std::vector<double> positions(int first, int end, int count) {
  std::vector<double> all;
  if (first == 0) all.push_back(0.0);
  for (int i = first; i < end; ++i) all.push_back((i + 0.5) / count);
  if (end == count) all.push_back(1.0);
  return all;
}

}  // namespace

bool is_finite(const glm::vec3& point) {
  return std::isfinite(point.x) && std::isfinite(point.y) && std::isfinite(point.z);
}

PositionMap::PositionMap(Image<glm::vec3> points) : points_(std::move(points)) {
  HPR_CHECK(points_.size().area() > 0);
  for (int y = 0; y < points_.height(); y += kBlockSide) {
    for (int x = 0; x < points_.width(); x += kBlockSide) {
      Block block{{x, y, std::min(x + kBlockSide, points_.width()), std::min(y + kBlockSide, points_.height())},
                  empty_bounds()};
      visit(block, [&](const glm::dvec3& point) {
        block.box.low = glm::min(block.box.low, point);
        block.box.high = glm::max(block.box.high, point);
      });
      if (block.box.low.x <= block.box.high.x) blocks_.push_back(block);
    }
  }
}

void PositionMap::visit(const Block& block, const std::function<void(const glm::dvec3& point)>& visitor) const {
  const std::vector<double> across = positions(block.cells.x0, block.cells.x1, points_.width());
  for (const double t : positions(block.cells.y0, block.cells.y1, points_.height())) {
    for (const double s : across) {
      if (const auto point = at(s, t)) visitor(*point);
    }
  }
}

std::optional<glm::dvec3> PositionMap::at(double s, double t) const {
  const Between x = between(s, points_.width());
  const Between y = between(t, points_.height());
  const std::array<double, 2> columns{1.0 - x.part, x.part};
  const std::array<double, 2> rows{1.0 - y.part, y.part};
  glm::dvec3 sum(0.0);
  for (std::size_t j = 0; j < 2; ++j) {
    for (std::size_t i = 0; i < 2; ++i) {
      const double weight = columns[i] * rows[j];
      if (weight == 0.0) continue;
      const glm::vec3& point = points_.at(x.first + static_cast<int>(i), y.first + static_cast<int>(j));
      if (!is_finite(point)) return std::nullopt;
      sum += weight * glm::dvec3(point);
    }
  }
  return sum;
}

std::optional<glm::dvec2> PixelPoints::seen(const glm::dvec3& point) const {
  const glm::dvec3 inside = glm::transpose(axes) * (point - eye);
  const glm::dvec2 aside(inside);
  if (orthographic) return aside * scale;
  const double ahead = -inside.z;
  if (!(ahead > 0.0) || !(glm::dot(aside, aside) <= kMaxTangent * kMaxTangent * ahead * ahead)) return std::nullopt;
  return aside / ahead;
}

std::optional<glm::dvec2> PixelPoints::seen_at(double s, double t) const {
  const auto point = map->at(s, t);
  return point ? seen(*point) : std::nullopt;
}

}  // namespace hpr
