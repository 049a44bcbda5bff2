#pragma once

#include <functional>
#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "image/image.h"
#include "scene/scene.h"

namespace hpr {

/// Whether all coordinates are finite: a point that is not says that no light falls there.
[[nodiscard]] bool is_finite(const glm::vec3& point);

/// Where the pixels of a screen lie that need not be a plane: points spread evenly over the screen, one for each of its
/// pixels or fewer.
class PositionMap {
 public:
  /// `points`: [height][width], not empty, row 0 at the top, metres in any one space.
  explicit PositionMap(Image<glm::vec3> points);

  [[nodiscard]] Size size() const { return points_.size(); }
  [[nodiscard]] const Image<glm::vec3>& points() const { return points_; }

  /// The point at (s, t) of the screen, from its upper left corner (0, 0) to its lower right one (1, 1): bilinear
  /// between the points, which lie at the centers of equal cells, and straight on beyond the outermost. None where a
  /// point it needs is not finite.
  [[nodiscard]] std::optional<glm::dvec3> at(double s, double t) const;

  /// A part of the map, with what its points fill.
  struct Block {
    Rect cells;
    Bounds box;
  };
  /// Those parts in which there are points; together they hold all that at() can be.
  [[nodiscard]] const std::vector<Block>& blocks() const { return blocks_; }
  /// The points of a part, and at the map's border those of the screen's edge.
  void visit(const Block& block, const std::function<void(const glm::dvec3& point)>& visitor) const;

 private:
  Image<glm::vec3> points_;
  std::vector<Block> blocks_;
};

/// A screen that is no plane as an eye sees it: its pixels look through points of their own.
struct PixelPoints {
  std::shared_ptr<const PositionMap> map;
  glm::dvec3 eye{0.0};   ///< in the map's space
  glm::dmat3 axes{1.0};  ///< of the view, in the map's space; columns: right, up, back
  bool orthographic = false;
  double scale = 1.0;  ///< orthographic: metres of the view to a metre of the map

  /// Where the eye sees a point of the map's space: on the plane one metre before it (perspective), or in metres about
  /// it (orthographic). None behind the eye, or 85 degrees and more off the view's axis.
  [[nodiscard]] std::optional<glm::dvec2> seen(const glm::dvec3& point) const;
  /// Where the eye sees the map's point at (s, t); none where seen() has none or the map has no point.
  [[nodiscard]] std::optional<glm::dvec2> seen_at(double s, double t) const;
};

}  // namespace hpr
