#include "raster/culling.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>

namespace hpr {
namespace {

/// Rounding of the matrix to float, four products and three sums, and an interpolation between two such results at each
/// of six clip planes: less than 32 times half a float's step, of the largest magnitude involved. Twice that is taken.
constexpr double kFloatError = 64.0 / 16777216.0;

/// Pixels by which GL's snapping to sub-pixels and its viewport transform in float may move a vertex, and more.
constexpr double kPixelMargin = 1.0;

glm::dvec4 row_of(const glm::dmat4& matrix, int row) {
  return {matrix[0][row], matrix[1][row], matrix[2][row], matrix[3][row]};
}

struct CenterHalf {
  glm::dvec4 center{0.0, 0.0, 0.0, 1.0};
  glm::dvec4 half{0.0};
  glm::dvec4 largest{0.0, 0.0, 0.0, 1.0};  ///< |position| at most, and 1
};

CenterHalf center_half(const Box& box) {
  const glm::dvec3 low(box.low);
  const glm::dvec3 high(box.high);
  return {glm::dvec4(0.5 * (low + high), 1.0), glm::dvec4(0.5 * (high - low), 0.0),
          glm::dvec4(glm::max(glm::abs(low), glm::abs(high)), 1.0)};
}

}  // namespace

Culler::Culler(const glm::dmat4& clip_from_mesh, const View& view, const Rect& part)
    : part_(part), size_(view.size()), near_(view.orthographic ? 0.0 : view.near_distance), matrix_(clip_from_mesh) {
  const glm::dvec4 x = row_of(matrix_, 0);
  const glm::dvec4 y = row_of(matrix_, 1);
  const glm::dvec4 z = row_of(matrix_, 2);
  const glm::dvec4 w = row_of(matrix_, 3);
  for (int row = 0; row < 4; ++row)
    row_error_[static_cast<std::size_t>(row)] = kFloatError * glm::abs(row_of(matrix_, row));

  // The part's edges in normalized device coordinates, a margin further out; y points up there.
  const double left = 2.0 * (part.x0 - kPixelMargin) / size_.width - 1.0;
  const double right = 2.0 * (part.x1 + kPixelMargin) / size_.width - 1.0;
  const double top = 1.0 - 2.0 * (part.y0 - kPixelMargin) / size_.height;
  const double bottom = 1.0 - 2.0 * (part.y1 + kPixelMargin) / size_.height;
  planes_ = {x - left * w, right * w - x, y - bottom * w, top * w - y, w - z, z};
  const auto error_of = [&](std::size_t row, double edge) { return row_error_[row] + std::abs(edge) * row_error_[3]; };
  error_ = {error_of(0, left), error_of(0, right), error_of(1, bottom),
            error_of(1, top),  error_of(2, 1.0),   error_of(2, 0.0)};
}

bool Culler::outside(const Box& box) const {
  const CenterHalf b = center_half(box);
  bool outside_part = false;
  for (std::size_t i = 0; i < kPlanes; ++i) {
    const double most = glm::dot(planes_[i], b.center) + glm::dot(glm::abs(planes_[i]), b.half);
    if (most >= -glm::dot(error_[i], b.largest)) continue;
    if (i >= kNear) return true;  // GL drops it whole, wherever it lies
    outside_part = true;
  }
  return outside_part && !near_breaks_down(box);
}

bool Culler::inside(const Box& box) const {
  const CenterHalf b = center_half(box);
  for (std::size_t i = 0; i < kPlanes; ++i) {
    const double least = glm::dot(planes_[i], b.center) - glm::dot(glm::abs(planes_[i]), b.half);
    if (!(least > glm::dot(error_[i], b.largest))) return false;
  }
  return true;
}

bool Culler::near_breaks_down(const Box& box) const {
  if (near_ == 0.0) return false;
  const CenterHalf b = center_half(box);
  const double least = glm::dot(planes_[kNear], b.center) - glm::dot(glm::abs(planes_[kNear]), b.half);
  const double error = glm::dot(row_error_[3], b.largest);
  return least <= error && error >= 0.25 * near_;
}

Rect Culler::pixels(const Box& box) const {
  const CenterHalf b = center_half(box);
  const double near_least = glm::dot(planes_[kNear], b.center) - glm::dot(glm::abs(planes_[kNear]), b.half);
  if (near_ != 0.0 && !(near_least > glm::dot(error_[kNear], b.largest))) return part_;

  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  double w_least = kInfinity;
  glm::dvec2 low(kInfinity);
  glm::dvec2 high(-kInfinity);
  for (int corner = 0; corner < 8; ++corner) {
    const glm::dvec4 sign((corner & 1) != 0 ? 1.0 : -1.0, (corner & 2) != 0 ? 1.0 : -1.0,
                          (corner & 4) != 0 ? 1.0 : -1.0, 0.0);
    const glm::dvec4 clip = matrix_ * (b.center + sign * b.half);
    w_least = std::min(w_least, clip.w);
    const glm::dvec2 ndc(clip.x / clip.w, clip.y / clip.w);
    low = glm::min(low, ndc);
    high = glm::max(high, ndc);
  }
  const glm::dvec2 reach = glm::max(glm::abs(low), glm::abs(high));
  const glm::dvec2 rounding(glm::dot(row_error_[0], b.largest), glm::dot(row_error_[1], b.largest));
  const double w_error = glm::dot(row_error_[3], b.largest);
  if (!(w_error < 0.5 * w_least)) return part_;
  const glm::dvec2 slack = 2.0 * (rounding + reach * w_error) / w_least;
  low -= slack;
  high += slack;

  const auto pixel = [](double value, int from, int to) {
    return static_cast<int>(std::clamp(value, static_cast<double>(from), static_cast<double>(to)));
  };
  const double half_width = 0.5 * size_.width;
  const double half_height = 0.5 * size_.height;
  return {pixel(std::floor((low.x + 1.0) * half_width - kPixelMargin), part_.x0, part_.x1),
          pixel(std::floor((1.0 - high.y) * half_height - kPixelMargin), part_.y0, part_.y1),
          pixel(std::ceil((high.x + 1.0) * half_width + kPixelMargin), part_.x0, part_.x1),
          pixel(std::ceil((1.0 - low.y) * half_height + kPixelMargin), part_.y0, part_.y1)};
}

}  // namespace hpr
