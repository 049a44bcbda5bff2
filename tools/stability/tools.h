#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <span>

#include "app/options/globals.h"
#include "image/color.h"
#include "image/key.h"
#include "image/tiles.h"
#include "raster/gl_context.h"
#include "rt/deferred_shader.h"
#include "scene/scene.h"
#include "scene/view.h"

/// What the cases about geometry share: small scenes, their keys and pictures, and how far two of them are apart.
namespace hpr::stability {

/// The unit roundoff of a float, 2^-24.
inline constexpr double kFloatRounding = 0x1p-24;

/// Adds the mesh, with normals if it has none, and an instance of it.
void add(Scene& scene, Mesh mesh, const glm::dmat4& to_world = glm::dmat4(1.0));

/// Two triangles in the plane z = 0.
[[nodiscard]] Mesh rectangle(const glm::vec2& low, const glm::vec2& high);

/// What an eye at the origin sees that looks along -z: `slope` metres to the right edge of the screen, one metre away.
[[nodiscard]] View head_on(Size size, double slope, double near_distance);

/// Draws keys with one OpenGL context, of the backend the user chose.
class Drawer {
 public:
  explicit Drawer(const Globals& globals);

  [[nodiscard]] Image<Key> draw(const Scene& scene, const View& view);
  /// A share of the scene.
  [[nodiscard]] TileLayer<Key> draw(const Scene& scene, const View& view, std::span<const SurfaceRange> objects);
  /// The whole scene, one part of the screen after the other.
  [[nodiscard]] TileLayer<Key> draw_parts(const Scene& scene, const View& view, std::span<const Rect> parts);

 private:
  std::unique_ptr<GlContext> context_;
};

/// How often a mesh's pixels are covered. Draws it in classes of triangles without a common corner, as far as 24
/// classes go, so that two triangles that claim one pixel are both seen.
struct Coverage {
  std::size_t missed = 0;  ///< pixels no triangle covers
  std::size_t twice = 0;   ///< pixels of two triangles or more

  Coverage& operator+=(const Coverage& other) {
    missed += other.missed;
    twice += other.twice;
    return *this;
  }
};
[[nodiscard]] Coverage coverage(Drawer& drawer, const Mesh& mesh, const glm::dmat4& to_world, const View& view);

/// The share of pixels that show another surface.
[[nodiscard]] double other_surfaces(const Image<Key>& a, const Image<Key>& b);
/// The share of pixels with a neighbour, of four, that shows another surface: where rounding can matter.
[[nodiscard]] double edges(const Image<Key>& keys);

/// A frame as `hpr render` makes it on one rank.
struct Picture {
  Image<Key> keys;
  Image<Rgb> radiance;
  RayCounts counts;
};
[[nodiscard]] Picture make_picture(const Globals& globals, const Scene& scene, const View& view,
                                   const RaySettings& settings = {});

/// The share of pixels in which a channel of the display colour is off by more than one level of 255.
[[nodiscard]] double other_colors(const Image<Rgb>& a, const Image<Rgb>& b);
/// The share of pixels with a neighbour, of four, whose display colour is off by more than one level.
[[nodiscard]] double color_edges(const Image<Rgb>& colors);

}  // namespace hpr::stability
