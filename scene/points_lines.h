#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "scene/scene.h"
#include "scene/view.h"

namespace hpr {

/// How wide points or lines are drawn. 0: not at all.
struct DrawnWidth {
  double value = 0.0;
  bool in_pixels = true;  ///< of the first views, where each point stands; else metres

  bool operator==(const DrawnWidth&) const = default;
};

struct PointLineWidths {
  DrawnWidth points{3.0};  ///< the diameter of their spheres
  DrawnWidth lines{2.0};   ///< of their tubes

  bool operator==(const PointLineWidths&) const = default;
};

/// "3px", "0.01m", or "3", which are pixels: up to 1000 px or 1e9 m. Throws Error (Usage).
[[nodiscard]] DrawnWidth parse_drawn_width(const std::string& text);
[[nodiscard]] std::string to_text(const DrawnWidth& width);

/// How large a view's pixels are.
struct PixelFootprint {
  glm::dvec3 eye{0.0};
  double metres = 0.0;        ///< a pixel's side: one metre from the eye, or anywhere (orthographic)
  double min_distance = 0.0;  ///< what is nearer to the eye counts as at this distance
  bool orthographic = false;

  bool operator==(const PixelFootprint&) const = default;

  /// A pixel's side, in metres, at a point of the world: by its distance from the eye, so that where the view turns,
  /// or another screen of a wall shows the point, nothing changes.
  [[nodiscard]] double at(const glm::dvec3& point) const;
};
[[nodiscard]] PixelFootprint footprint_of(const View& view);

/// How large the pixels of several views are, such as those of a wall whose screens have unlike pixels.
class PixelFootprints {
 public:
  explicit PixelFootprints(std::span<const View> views);

  /// A pixel's side, in metres, at a point of the world: of the view that shows the point, the largest where several
  /// do, of the first view where none does.
  [[nodiscard]] double at(const glm::dvec3& point) const;
  /// Whether it is the same everywhere.
  [[nodiscard]] bool is_constant() const;

 private:
  PixelFootprint first_;
  /// All of them, with their views; empty where all have the first one's pixels.
  std::vector<std::pair<PixelFootprint, View>> each_;
};

[[nodiscard]] bool has_points_or_lines(const Scene& scene);

/// Makes triangles of points and lines: each point becomes a sphere, each segment a tube with hemispheres at its ends,
/// of the given width in the world, however their instance scales. The outcome depends on the arguments alone; `views`
/// are one or more.
///
/// A sphere is an octahedron where it is less than 6 pixels wide, then an icosahedron divided 0 (below 16
/// pixels), 1 (48), 2 (150) or 3 times; a tube has 4 (below 6), 8 (24), 16 (100) or 32 sides, so that outlines are off
/// by about a pixel. All are coarser as far as is needed for 2^24 triangles. Their mean width or area is that of what
/// they stand for, their normals are its own. A segment that starts where another one of its mesh ends has no
/// hemisphere there, one without a length is not drawn. Widths in metres and orthographic pixels keep meshes shared
/// between instances that differ by no more than rotations and moves; with perspective pixels each instance has its
/// own.
///
/// Then the scene is finished (finish_scene). Throws Error (Limit) before allocating more than `memory_bytes`, what the
/// scene has included.
void shape_points_and_lines(Scene& scene, const PointLineWidths& widths, std::span<const View> views,
                            std::uint64_t memory_bytes);

}  // namespace hpr
