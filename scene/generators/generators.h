#pragma once

#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <initializer_list>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "scene/scene.h"

namespace hpr {

/// The options of `gen:NAME?key=value&...`; every generator refuses keys it does not know (ExitCode::Usage, nearest
/// name).
using GeneratorOptions = std::map<std::string, std::string>;

/// A scene HPR makes itself: deterministic on every rank, compiler and machine.
struct Generator {
  std::string name;
  std::string summary;                         ///< one line for `hpr scene list`
  std::map<std::string, std::string> options;  ///< key -> what it does, with its default
  /// The finished scene; points and lines have no shapes yet, see shape_points_and_lines. Throws Error (Usage) for an
  /// option it does not know or a value out of range.
  std::function<Scene(const GeneratorOptions&)> make;
  /// The size options whose triangle count is nearest to the given one; empty where the scene has only one size.
  std::function<GeneratorOptions(std::uint64_t)> sized;
};

/// Every generator this build knows, in the order lists show them.
[[nodiscard]] const std::vector<Generator>& all_generators();

/// Throws Error (Usage) for an unknown name, with the nearest one.
[[nodiscard]] const Generator& find_generator(std::string_view name);

/// `text` is what follows "gen:", e.g. "gallery?s=2&k=4". The scene is finished, but for the shapes of points
/// and lines (shape_points_and_lines). Throws Error (Usage) for an unknown name or option, or a value out of range.
[[nodiscard]] Scene generate_scene(std::string_view text);

/// Options that make the generator's scene about `triangles` triangles large, instances counted: the nearest size it
/// has.
[[nodiscard]] GeneratorOptions options_for_triangles(const Generator& generator, std::uint64_t triangles);

/// Every generator, in the order in which lists show them: X(tetra) stands for tetra.cpp, which defines
/// tetra_generator().
#define HPR_GENERATORS(X) \
  X(gallery)              \
  X(extensions)           \
  X(sphereflake)          \
  X(tetra)                \
  X(cornell)              \
  X(asteroids)            \
  X(cloud)

#define HPR_DECLARE_GENERATOR(name) [[nodiscard]] Generator name##_generator();
HPR_GENERATORS(HPR_DECLARE_GENERATOR)
#undef HPR_DECLARE_GENERATOR

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

/// Adds a material or a mesh to `scene` and returns its index.
[[nodiscard]] std::uint32_t add_material(Scene& scene, Material material);
[[nodiscard]] std::uint32_t add_mesh(Scene& scene, Mesh mesh, std::string name, std::uint32_t material);
/// Adds a mesh with one instance, whose matrix is the identity.
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

/// A sphere of the flake and the axis it grew along (unit length).
struct FlakeSphere {
  glm::dvec3 center{0.0};
  double radius = 0.0;
  glm::dvec3 axis{0.0, 0.0, 1.0};
};

/// Haines' sphereflake ("A Proposal for Standard Graphics Environments", IEEE CG&A 7(11), 1987) in the coordinates of
/// the Standard Procedural Databases: left-handed, z up, a root of radius 1/2 at the origin. `size` generations after
/// the root: (9^(size + 1) - 1) / 8 spheres, every sphere before its children.
[[nodiscard]] std::vector<FlakeSphere> sphereflake(int size);

/// From the databases' left-handed, z-up coordinates to ours, right-handed and y up: y and z change places, which is
/// the negation of one axis that handedness needs and a quarter turn in one. Pictures stay the same.
[[nodiscard]] inline glm::dvec3 from_spd(const glm::dvec3& p) {
  return {p.x, p.z, p.y};
}

}  // namespace hpr
