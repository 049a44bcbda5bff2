#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec2.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "walls/geometry/warped_picture.h"

namespace hpr {

/// Triangles that say which place of a flat picture is shown where on a screen. Both are in [0, 1], from the lower left
/// corner, y up; between corners of a triangle the source is linear.
struct WarpMesh {
  struct Vertex {
    glm::dvec2 place{0.0};   ///< on the screen
    glm::dvec2 source{0.0};  ///< of the picture
  };

  std::vector<Vertex> vertices;
  std::vector<std::array<std::uint32_t, 3>>
      triangles;  ///< of one orientation on the screen, but for those without area
};

/// A text of lines `x,y,u,v`, a vertex of a grid each: row after row, of equal lengths, along each of which x rises; a
/// first line of names, empty lines and what follows # are skipped. Throws Error (BadInput) with `name` and the line;
/// also for a mesh that folds over.
[[nodiscard]] WarpMesh parse_warp_csv(std::string_view text, const std::string& name);

/// A Wavefront OBJ of `v x y`, `vt u v` and faces of these, whatever their corners; other lines are skipped. Throws as
/// parse_warp_csv does.
[[nodiscard]] WarpMesh parse_warp_obj(std::string_view text, const std::string& name);

/// Per pixel of a screen the place of a picture of that size it shows: of its centre, in the first triangle that holds
/// it; kNoSource outside of all.
[[nodiscard]] Image<SourcePlace> mesh_sources(const WarpMesh& mesh, Size size);

}  // namespace hpr
