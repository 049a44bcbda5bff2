#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/vec2.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "scene/position_map.h"

namespace hpr {

/// Linear light in [0, 1] to one of 256 levels, as a formula has it, without its powers.
class LevelTable {
 public:
  /// `level`: what a light is shown as, in [0, 1]; must rise with it.
  explicit LevelTable(const std::function<double(float light)>& level);

  /// The level of `light`, rounded; below 0 and NaN that of 0, above 1 that of 1.
  [[nodiscard]] std::uint8_t operator()(float light) const;

 private:
  static constexpr int kSteps = 1024;

  std::array<float, 257> least_{};  ///< light from which on the level is at least this
  std::array<std::uint8_t, kSteps + 1> start_{};
};

/// A place in a picture, in 65536ths of a pixel from the middle of its upper left one to the right and down.
struct SourcePosition {
  std::uint32_t x = 0;
  std::uint32_t y = 0;

  bool operator==(const SourcePosition&) const = default;
};

/// Pixels a side of the largest picture that a SourcePosition can point into.
inline constexpr int kMaxSourceSide = 65536;

/// Nothing of the picture: no light.
inline constexpr SourcePosition kNoSource{0xFFFFFFFFU, 0xFFFFFFFFU};

/// The place nearest to (x, y), in pixels from the picture's upper left corner; beyond the middles of the outermost
/// pixels that of these. `size` of the picture, at most kMaxSourceSide a side.
[[nodiscard]] SourcePosition source_position(double x, double y, Size size);

/// What a picture shows at these places: bilinear between the middles of its four nearest pixels, in linear light,
/// rounded to sRGB levels; in the middle of a pixel that pixel, bit by bit. Black, and opaque, where there is none. The
/// same bits for any number of threads.
[[nodiscard]] Image<Rgba8> warped(const Image<Rgba8>& picture, const Image<SourcePosition>& sources, int threads);

/// A PFM of three channels (Debevec's portable float map: "PF", width and height, a scale whose sign tells the byte
/// order, then rows from the bottom up): per texel a point in metres, wall space; NaN or infinite where no light falls.
/// Throws Error (BadInput) with `name`: no such file, a length that does not fit, no point at all, points beyond a
/// thousand kilometres.
[[nodiscard]] PositionMap parse_position_map(std::span<const std::byte> bytes, const std::string& name);

/// Triangles that say which place of a flat picture is shown where on a screen. Both are in [0, 1], from the lower left
/// corner, y up; between corners of a triangle the source is linear.
struct WarpMesh {
  struct Vertex {
    glm::dvec2 position{0.0};  ///< on the screen
    glm::dvec2 source{0.0};    ///< of the picture
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
[[nodiscard]] Image<SourcePosition> mesh_sources(const WarpMesh& mesh, Size size);

}  // namespace hpr
