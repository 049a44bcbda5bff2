#pragma once

#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <random>
#include <string>
#include <vector>

#include "app/options/globals.h"
#include "image/color.h"
#include "image/image.h"
#include "image/key.h"
#include "image/tiles.h"
#include "rt/deferred_shader.h"
#include "scene/scene.h"
#include "scene/view.h"
#include "tools/stability/stability.h"

/// What the cases about light share: small scenes, and pictures of them lit without GL.
namespace hpr::stability {

/// A stream of numbers that is the same on every machine.
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

/// A finding whose measured value is still 0.
[[nodiscard]] StabilityFinding finding(std::string name, std::string parameter, double limit, std::string unit,
                                       std::string why);

/// The unit roundoff of a double, 2^-53.
inline constexpr double kDoubleRounding = 0x1p-53;

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

/// Threads a case may use.
[[nodiscard]] int threads_of(const Globals& globals);

/// White Lambert without a specular layer.
[[nodiscard]] Material matte(const glm::vec3& color = glm::vec3(1.0F));
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
/// Red of the pixel of such a view.
[[nodiscard]] double glanced(const Scene& scene, const View& view, const RaySettings& settings);
/// Settings that run these passes and no others.
[[nodiscard]] RaySettings only(std::vector<PassId> passes, int threads = 1);

/// The worse of two measured numbers, of which larger is worse: a NaN is the worst there is.
[[nodiscard]] double worse(double a, double b);

}  // namespace hpr::stability
