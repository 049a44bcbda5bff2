#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <optional>
#include <span>
#include <vector>

#include "raster/geometry.h"
#include "scene/view.h"

namespace hpr {

/// Decides in double what boxes of one mesh, under one matrix, can touch inside a rectangle of a view. Conservative
/// against what GL does in float: a box is outside only when every point of it is, by more than the rounding of
/// GL's transform and clipping, plus a pixel for its snapping to sub-pixels.
///
/// Why a plane test is enough: a triangle's visible points have w > 0 and are convex combinations of its corners, so
/// where x - n w < 0 holds for all corners, whatever the sign of their w, x / w < n holds for all that is visible
/// (Blinn and Newell, Clipping Using Homogeneous Coordinates, 1978).
class Culler {
 public:
  /// `clip_from_mesh`: as composed in double, before the cast to float. `part`: not empty; it may reach past the view.
  Culler(const glm::dmat4& clip_from_mesh, const View& view, const Rect& part);

  /// Nothing in the box can be drawn inside the part.
  [[nodiscard]] bool outside(const Box& box) const;
  /// Everything in the box lies inside the part and before the near plane, so no smaller box in it is outside.
  [[nodiscard]] bool inside(const Box& box) const;
  /// A rectangle of the part that holds every pixel the box's content can touch.
  [[nodiscard]] Rect pixels(const Box& box) const;

 private:
  static constexpr std::size_t kPlanes = 6;
  static constexpr std::size_t kNear = 4;

  /// Whether rounding may turn the sign of w where GL cuts the box's triangles at the near plane. Nothing can be said
  /// about where such a triangle ends up.
  [[nodiscard]] bool near_breaks_down(const Box& box) const;

  Rect part_;
  Size size_;
  double near_ = 0.0;  ///< w at the near plane; 0: orthographic, w is 1 everywhere
  glm::dmat4 matrix_;
  std::array<glm::dvec4, kPlanes> planes_{};  ///< left, right, bottom, top, near, far: positive inside
  std::array<glm::dvec4, kPlanes> error_{};   ///< dotted with (|position|, 1): what GL's float may be off by
  std::array<glm::dvec4, 4> row_error_{};     ///< the same for clip x, y, z, w
};

/// GL's DrawElementsIndirectCommand.
struct DrawCommand {
  std::uint32_t count = 0;  ///< indices
  std::uint32_t instances = 1;
  std::uint32_t first_index = 0;
  std::int32_t base_vertex = 0;
  std::uint32_t base_instance = 0;  ///< which DrawRecord
};

/// What the vertex shader needs to know of a command.
struct DrawRecord {
  std::array<float, 16> clip_from_mesh{};  ///< [column][row]
  std::uint32_t first_surface = 0;         ///< of the instance
  std::array<std::uint32_t, 3> padding{};
};

/// Which triangles are drawn, by how they are wound on the screen.
enum class Winding : std::uint8_t { Any, Counterclockwise, Clockwise };

/// Commands [first, first + count) of a list, drawn alike.
struct DrawSpan {
  Winding winding = Winding::Any;
  std::size_t first = 0;
  std::size_t count = 0;
};

/// What to draw into one rectangle: commands in ascending order of surface id.
struct DrawList {
  std::vector<DrawCommand> commands;
  std::vector<DrawSpan> spans;  ///< all commands, in their order; neighbors differ in their winding
  std::vector<DrawRecord> records;
  Rect pixels;  ///< of the part; nothing outside it can be drawn
  std::uint64_t triangles_drawn = 0;
  std::uint64_t triangles_culled = 0;
  std::uint64_t chunks_drawn = 0;
  std::uint64_t chunks_culled = 0;
};

enum class Culling {
  Chunks,  ///< against the drawn rectangle
  None,    ///< everything is sent to GL, for tests and comparisons
};

/// The matrix of an instance for vertices in mesh coordinates, from that of positions relative to the eye; none where
/// it overflows a float, and nothing is drawn.
[[nodiscard]] std::optional<glm::dmat4> drawable_matrix(const Instance& instance,
                                                        const glm::dmat4& clip_from_eye_relative,
                                                        const glm::dvec3& eye);

/// Culls `pieces` of the geometry against `part`, a rectangle inside the view. Instances whose matrix overflows a float
/// are left out, by the same rule on every rank. `only`: merged ranges; of the pieces, chunks of these surfaces alone
/// are drawn. Null: all are.
[[nodiscard]] DrawList make_draw_list(const Scene& scene, const Geometry& geometry, std::span<const Piece> pieces,
                                      const View& view, const Rect& part, Culling culling, int threads,
                                      const std::vector<SurfaceRange>* only = nullptr);

/// Splits a list into at most `count` lists of as many triangles each, but for one, none of them empty; commands are
/// cut where need be. Their keys, merged by maximum, are those of the list. What is counted stays with the first.
[[nodiscard]] std::vector<DrawList> split_list(DrawList list, std::size_t count);

}  // namespace hpr
