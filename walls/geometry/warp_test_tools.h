#pragma once

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <glm/vec3.hpp>
#include <numbers>
#include <span>
#include <string>
#include <vector>

#include "image/image.h"

namespace hpr::test {

/// A PFM as calibrations write it: little-endian, rows from the bottom up.
inline std::vector<std::byte> pfm(const Image<glm::vec3>& points) {
  const std::string header = fmt::format("PF\n{} {}\n-1.0\n", points.width(), points.height());
  const auto text = std::as_bytes(std::span(header));
  std::vector<std::byte> bytes(text.begin(), text.end());
  for (int y = points.height() - 1; y >= 0; --y) {
    const auto row = std::as_bytes(points.row(y));
    bytes.insert(bytes.end(), row.begin(), row.end());
  }
  return bytes;
}

/// What a projector lights of an upright cylinder about the y axis: angles in degrees from -z to the right, heights in
/// metres.
struct Arc {
  double radius = 3.0;
  double left = -40.0;
  double right = 40.0;
  double bottom = 0.0;
  double top = 3.0;

  [[nodiscard]] glm::dvec3 at(double s, double t) const {
    const double angle = (left + (right - left) * s) * std::numbers::pi / 180.0;
    return {radius * std::sin(angle), top + (bottom - top) * t, -radius * std::cos(angle)};
  }
  [[nodiscard]] Image<glm::vec3> points(Size size) const {
    Image<glm::vec3> map(size);
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) map.at(x, y) = at((x + 0.5) / size.width, (y + 0.5) / size.height);
    }
    return map;
  }
};

}  // namespace hpr::test
