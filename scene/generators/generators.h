#pragma once

#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "scene/generators/generated.h"

/// One factory per generator, listed by all_generators(), and what they share.
namespace hpr {

[[nodiscard]] Generator gallery_generator();
[[nodiscard]] Generator sphereflake_generator();
[[nodiscard]] Generator tetra_generator();
[[nodiscard]] Generator cornell_generator();
[[nodiscard]] Generator asteroids_generator();

/// The values of a generator's options, checked.
class OptionReader {
 public:
  /// Throws Error (Usage) when `options` has a key that `generator` does not describe.
  OptionReader(const Generator& generator, const GeneratorOptions& options);

  /// Throws Error (Usage) when the value is no integer in [low, high].
  [[nodiscard]] int integer(const std::string& key, int fallback, int low, int high) const;
  /// Throws Error (Usage) when the value is none of `choices`; the first one is the default.
  [[nodiscard]] std::string choice(const std::string& key, const std::vector<std::string>& choices) const;

 private:
  std::string generator_;
  const GeneratorOptions& options_;
};

/// Completes a generator by the function that fills its scene, which then gets the generator's name and is finished.
[[nodiscard]] Generator filled_by(Generator generator, void (*fill)(Scene& scene, const OptionReader& options));

/// A size a generator can make.
struct SceneSize {
  std::uint64_t triangles = 0;
  GeneratorOptions options;
};
/// The options of the size whose count differs least from `triangles`; the smaller one of two equally near.
[[nodiscard]] GeneratorOptions nearest_size(const std::vector<SceneSize>& sizes, std::uint64_t triangles);

/// Adds to `scene` and returns the index.
[[nodiscard]] std::uint32_t add_material(Scene& scene, Material material);
[[nodiscard]] std::uint32_t add_mesh(Scene& scene, Mesh mesh, std::string name, std::uint32_t material);
/// A mesh with one instance, where it is.
void add_single(Scene& scene, Mesh mesh, std::string name, std::uint32_t material);
void add_instance(Scene& scene, std::uint32_t mesh, const glm::dmat4& to_world = glm::dmat4(1.0));
void add_point_light(Scene& scene, std::string name, const glm::dvec3& position, const glm::vec3& intensity);
/// A light of the Standard Procedural Databases, which do not fade with distance: as many candela as give `irradiance`
/// at the origin. `position` is in the databases' coordinates.
void add_spd_light(Scene& scene, const glm::dvec3& position, double irradiance);
void add_camera(Scene& scene, std::string name, const glm::dvec3& eye, const glm::dvec3& at, const glm::dvec3& up,
                double vertical_fov_degrees);

/// Dielectric, diffuse when rough.
[[nodiscard]] Material plastic(std::string name, const glm::vec3& color, float roughness);
[[nodiscard]] Material metal(std::string name, const glm::vec3& color, float roughness);
/// Smooth and clear, of index of refraction `ior`; solid, so its surfaces are to be closed.
[[nodiscard]] Material glass(std::string name, float ior);

}  // namespace hpr
