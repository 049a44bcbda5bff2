#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "raster/geometry.h"
#include "scene/view.h"

namespace hpr {

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

/// What to draw into one rectangle: commands in ascending order of surface id.
struct DrawList {
  std::vector<DrawCommand> commands;
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

/// Culls the share against `part`, a rectangle inside the view. Instances whose matrix overflows a float are left out,
/// by the same rule on every rank.
[[nodiscard]] DrawList make_draw_list(const Scene& scene, const Geometry& geometry, const View& view, const Rect& part,
                                      Culling culling, int threads);

}  // namespace hpr
