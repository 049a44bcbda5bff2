#pragma once

#include <array>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include "image/color.h"
#include "image/image.h"
#include "scene/scene.h"

/// The solids generated scenes are made of. Triangles wind counter-clockwise seen from outside; every result is the
/// same to the bit on every machine. Coordinates are computed in double and rounded once.
namespace hpr::shapes {

/// Adds a flat quad (2 triangles) to `mesh`: corners counter-clockwise seen from its front, the lower left one of its
/// picture first. Texture coordinates cover [0, 1]^2 with v = 0 along the last edge, times `repeat`.
void add_quad(Mesh& mesh, const std::array<glm::dvec3, 4>& corners, const glm::dvec2& repeat = {1.0, 1.0});

/// Adds an axis-aligned box (12 triangles), each face with the whole texture.
void add_box(Mesh& mesh, const glm::dvec3& low, const glm::dvec3& high);

/// The unit sphere as an icosahedron divided `level` times: 20 * 4^level triangles, 10 * 4^level + 2 vertices.
[[nodiscard]] Mesh icosphere(int level);

/// The unit sphere as a cube of n x n squares a face, projected: 12 n^2 triangles, 6 n^2 + 2 vertices.
[[nodiscard]] Mesh cube_sphere(int n);

/// A tube of radius `tube` about the (p, q) torus knot ((2 + cos q t) cos p t, sin q t, (2 + cos q t) sin p t) / 3 of
/// outer radius 1: 2 * along * around triangles, closed.
[[nodiscard]] Mesh torus_knot(int p, int q, int along, int around, double tube);

/// An open vase with a wall of finite thickness, a solid of revolution 1 high that stands on y = 0: 4n segments around,
/// 8n from the bottom's centre over the lip to the inside's centre, so 64 n^2 - 8n triangles, closed. That is the count
/// of Newell's 32 teapot patches at n x n quads with the collapsed triangles at the poles left out. `n` is even.
[[nodiscard]] Mesh vase(int n);

/// `scale` times, then moved to `center`.
[[nodiscard]] glm::dmat4 placed(const glm::dvec3& center, double scale);

}  // namespace hpr::shapes

/// Test pictures with a known right answer, sRGB, the same to the bit on every machine.
namespace hpr::patterns {

/// Intensity 0.5 + 0.5 cos(2 pi r^2 / (2 width)), r in texels from the centre: reaches the sampling limit of half a
/// cycle a texel at the left and right edge.
[[nodiscard]] Image<Rgba8> zone_plate(Size size);

/// Black lines one texel wide at every multiple of `step` texels, on white.
[[nodiscard]] Image<Rgba8> texel_grid(Size size, int step);

/// 2 * lines sectors, black and white in turn, about the centre. `lines` is even, so that the star is symmetric.
[[nodiscard]] Image<Rgba8> siemens_star(Size size, int lines);

/// `steps` equal bars from black to white, even in sRGB levels.
[[nodiscard]] Image<Rgba8> grey_wedge(Size size, int steps);

/// Says of each texel where it is: red grows with x, green with y, and every cell of 32 x 32 texels bears its column
/// (upper row) and line (lower row) as five squares of binary digits, most significant first. A shifted, doubled or
/// missing tile shows.
[[nodiscard]] Image<Rgba8> tile_ruler(Size size);

/// Two squares a side: `odd` at the upper left and lower right.
[[nodiscard]] Image<Rgba8> checker(Rgb odd, Rgb even);

}  // namespace hpr::patterns
