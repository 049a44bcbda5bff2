#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "app/options/globals.h"
#include "image/color.h"
#include "image/image.h"
#include "image/key.h"
#include "image/tiles.h"
#include "raster/gl_context.h"
#include "rt/deferred_shader.h"
#include "scene/scene.h"
#include "scene/view.h"
#include "tools/stability/stability.h"

/// What cases share: small scenes, their keys and pictures, and how far two of them are apart.
namespace hpr::stability {

// Numbers.

/// The unit roundoff of a float, 2^-24.
inline constexpr double kFloatRounding = 0x1p-24;
/// The unit roundoff of a double, 2^-53.
inline constexpr double kDoubleRounding = 0x1p-53;

/// Random numbers that are equal on every machine.
class RandomStream {
 public:
  explicit RandomStream(std::uint64_t seed) : bits_(seed) {}

  /// In [0, 1).
  [[nodiscard]] double one() { return static_cast<double>(bits_() >> 11U) * 0x1p-53; }
  [[nodiscard]] std::size_t below(std::size_t count) { return bits_() % count; }
  [[nodiscard]] glm::dvec3 on_sphere();
  [[nodiscard]] glm::dvec3 in_ball();

 private:
  std::mt19937_64 bits_;
};

/// A sum that loses nothing to speak of: Kahan's compensation on top of 64 bits.
struct ExactSum {
  long double sum = 0.0L;
  long double rest = 0.0L;

  void add(long double value) {
    const long double term = value - rest;
    const long double next = sum + term;
    rest = (next - sum) - term;
    sum = next;
  }
};

/// The worse of two measured numbers, of which larger is worse: a NaN is the worst there is.
[[nodiscard]] double worse(double a, double b);

// Findings.

/// A finding whose measured value is still 0.
[[nodiscard]] StabilityFinding make_finding(std::string name, std::string parameter, double limit, std::string unit,
                                            std::string why);
/// Appends (parameter, measured) to the finding's curve; where it is promised, `measured` also counts for the finding's
/// worst number, of which larger is worse.
void add_point(StabilityFinding& finding, double parameter, double measured, bool promised = true);

// Keys and pictures of scenes, drawn with OpenGL.

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
  /// The surfaces of `objects` alone.
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

/// A frame as `hpr render --primary raster` makes it on one rank.
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

// Light without OpenGL.

/// Threads a case may use.
[[nodiscard]] int threads_of(const Globals& globals);

/// White Lambert without a specular layer.
[[nodiscard]] Material diffuse(const glm::vec3& color = glm::vec3(1.0F));
/// A metal that reflects so much in one direction.
[[nodiscard]] Material mirror(float reflectance);

/// Adds `mesh` with one instance of it. Returns the mesh's index.
std::uint32_t add_placed(Scene& scene, Mesh mesh, const Material& material, const glm::dmat4& to_world);
/// The parallelogram corner, corner + a, corner + a + b, corner + b; its normal is a x b.
[[nodiscard]] Mesh parallelogram(const glm::dvec3& corner, const glm::dvec3& a, const glm::dvec3& b);

/// A picture and what it took.
struct LitPicture {
  TileLayer<Key> keys;
  Image<Rgb> image;
  RayCounts counts;
};
/// One sample of a finished scene, its keys made by primary rays.
[[nodiscard]] LitPicture lit_picture(const Scene& scene, const View& view, const RaySettings& settings);

/// A view of one pixel, whose ray goes from `eye` through `at`.
[[nodiscard]] View glance(const Scene& scene, const glm::dvec3& eye, const glm::dvec3& at);
/// The red of the pixel of a view of one pixel.
[[nodiscard]] double glanced(const Scene& scene, const View& view, const RaySettings& settings);
/// Settings that run these passes and no others.
[[nodiscard]] RaySettings only(std::vector<PassId> passes, int threads = 1);

// One small scene with something of everything that light does, to be moved and scaled.

/// On a floor of 6 m: a diffuse sphere, a mirror, a ball of tinted glass and a box, lit by a small lamp, the sun and a
/// glowing panel. Positions are multiples of 1 / `steps_per_metre`, if that is not 0.
[[nodiscard]] Scene exhibits(double steps_per_metre = 0.0);
/// The view of exhibits(), 256 x 192 pixels; positions are multiples of 1 / `steps_per_metre`, if that is not 0.
[[nodiscard]] View exhibits_view(double steps_per_metre = 0.0);
/// Settings for exhibits(): all passes, and photons.
[[nodiscard]] RaySettings exhibits_light();

/// Scales the scene by `factor` about the world's origin, in its placements.
void scale_placements(Scene& scene, double factor);
/// scale_placements() in the scene's vertices: exact where `factor` is a power of two.
void scale_vertices(Scene& scene, double factor);
void scale_view(View& view, double factor);

/// Moves the scene by `offset` in its placements.
void move_placements(Scene& scene, const glm::dvec3& offset);
/// Moves the scene by `offset` in its vertices, which then are world coordinates in floats.
void move_vertices(Scene& scene, const glm::dvec3& offset);

}  // namespace hpr::stability
