#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "rt/lights/environment_map.h"
#include "rt/lights/light_tree.h"
#include "rt/lights/punctual_light.h"
#include "rt/lights/triangle_lights.h"
#include "rt/trace/surfaces.h"
#include "scene/scene.h"
#include "scene/view.h"

namespace hpr {

/// Whether an environment of one radiance is sampled as a light, or left to rays of all directions.
enum class ConstantEnvironment : std::uint8_t { Sampled, LeftToRays };

/// All that gives light in a scene: punctual lights (KHR_lights_punctual), spheres (lights with a radius), triangles
/// that emit (from both sides, as they are shown), and the environment. Knows nothing of visibility.
///
/// A `normal` stands for the side a surface takes light on: lights wholly below its plane are never chosen, and a
/// constant environment is sampled by the cosine. Where light may also come through the surface, pass a zero normal.
/// All numbers `u` lie in [0, 1).
class LightSampler {
 public:
  /// The scene must outlive this. A scene that gives no light (gives_light) gets a headlight. Lights without any
  /// intensity are left out. O(n log n) for n lights.
  explicit LightSampler(const Scene& scene, ConstantEnvironment constant_environment = ConstantEnvironment::Sampled);

  /// The number of lights that every vertex samples one by one: punctual and sphere lights, unless there are more than
  /// kMaxEnumerated; then 0, and all are in the tree.
  [[nodiscard]] std::size_t enumerated() const;
  /// A sample of enumerated light i. `u` is used by lights with an extent. weight is zero where it does not reach.
  [[nodiscard]] LightSample sample_enumerated(std::size_t light, const glm::dvec3& position, const View& view,
                                              const glm::dvec2& u) const;
  /// Whether every sample of enumerated light i is equal (it has no extent): then more samples of it are of no
  /// use.
  [[nodiscard]] bool enumerated_is_fixed(std::size_t light) const;

  /// Whether there are lights beside the enumerated ones: emitting triangles, the environment, and, when they are many,
  /// all.
  [[nodiscard]] bool has_tree() const;
  /// A sample of one of the lights that are not enumerated, chosen by what it may give to a surface at `position` with
  /// `normal` (a light tree: Conty and Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting", 2018).
  /// None when no light reaches it.
  [[nodiscard]] std::optional<LightSample> sample(const glm::dvec3& position, const glm::dvec3& normal,
                                                  const View& view, double u_choice, const glm::dvec2& u) const;

  /// A sample of one of all lights, enumerated or not, for path tracing; the headlight is one of them.
  [[nodiscard]] std::optional<LightSample> sample_any(const glm::dvec3& position, const glm::dvec3& normal,
                                                      const View& view, double u_choice, const glm::dvec2& u) const;

  /// Per solid angle: the density with which sample (or sample_any) at `position` picks the direction to the point
  /// `hit` of an emitting surface; of a sample, the very pdf it says. 0 for surfaces that do not emit.
  [[nodiscard]] double surface_pdf(const glm::dvec3& position, const glm::dvec3& normal, std::uint32_t surface,
                                   const SurfacePoint& hit) const;
  [[nodiscard]] double surface_pdf_any(const glm::dvec3& position, const glm::dvec3& normal, std::uint32_t surface,
                                       const SurfacePoint& hit) const;

  /// Radiance from outside the scene along `direction`: the environment, or the background where there is none.
  [[nodiscard]] glm::dvec3 environment(const glm::dvec3& direction) const;
  /// The radiance from outside the scene where no direction changes it.
  [[nodiscard]] std::optional<glm::dvec3> constant_environment() const;
  /// An upper estimate of the irradiance of an environment that nothing hides, mean of the channels, in W/m^2.
  [[nodiscard]] double environment_irradiance(const glm::dvec3& normal) const;
  [[nodiscard]] double environment_pdf(const glm::dvec3& position, const glm::dvec3& normal,
                                       const glm::dvec3& direction) const;
  [[nodiscard]] double environment_pdf_any(const glm::dvec3& position, const glm::dvec3& normal,
                                           const glm::dvec3& direction) const;

  /// Watts of all lights together, mean of the three channels (directional lights and the environment: through the
  /// scene's bounding sphere). Where emission or environment have textures, estimated.
  [[nodiscard]] double power() const;
  /// A photon, lights chosen by their power; the mean flux of all is what they send out. Ranges end no photon. None
  /// when nothing gives light (a headlight sends no photons).
  [[nodiscard]] std::optional<PhotonStart> emit(double u_choice, const glm::dvec2& u_place,
                                                const glm::dvec2& u_direction) const;

  static constexpr std::size_t kMaxEnumerated = 64;

  /// Lights that can be chosen from: those that stand somewhere in a tree, the others beside it. They are numbered:
  /// punctual ones, triangles, the environment.
  struct Choices {
    LightTree tree;
    std::vector<std::uint32_t> in_tree;  ///< light of each of the tree's
    std::size_t first_triangle = 0;      ///< of the tree's lights; triangles come last, in order
    std::vector<std::uint32_t> outside;  ///< directional lights, the headlight, the environment
    std::vector<double> outside_sums;    ///< of their irradiance
  };
  /// What sample() chooses from.
  [[nodiscard]] const Choices& choices() const { return one(); }
  /// Enumerated or not; in a scene that gives no light, the headlight.
  [[nodiscard]] std::span<const Light> punctual() const { return punctual_; }
  [[nodiscard]] const TriangleLights& triangles() const { return triangles_; }
  [[nodiscard]] const std::optional<EnvironmentMap>& environment_map() const { return environment_; }
  /// What emit() chooses from: running sums over all lights.
  [[nodiscard]] std::span<const double> power_sums() const { return power_sums_; }
  /// What photons of every light but the environment start in; empty where no solid absorbs.
  [[nodiscard]] std::span<const Media> media() const { return media_; }
  /// What photons from outside cross.
  [[nodiscard]] const LitSphere& lit_sphere() const { return lit_; }

 private:
  struct Chosen {
    std::size_t light = 0;
    double probability = 0.0;
    double rest = 0.0;  ///< of the random number, for lights outside the tree
  };

  [[nodiscard]] std::size_t environment_number() const { return punctual_.size() + triangles_.size(); }
  [[nodiscard]] const Choices& one() const { return enumerated_ > 0 ? sampled_ : all_; }
  [[nodiscard]] Choices make_choices(bool punctual) const;
  void sum_powers();
  void find_media(const Scene& scene);
  [[nodiscard]] double outside_share(const Choices& choices, const glm::dvec3& position,
                                     const glm::dvec3& normal) const;
  [[nodiscard]] std::optional<Chosen> choose(const Choices& choices, const glm::dvec3& position,
                                             const glm::dvec3& normal, double u) const;
  [[nodiscard]] std::optional<LightSample> sample(const Choices& choices, const glm::dvec3& position,
                                                  const glm::dvec3& normal, const View& view, double u_choice,
                                                  const glm::dvec2& u) const;
  void sample_environment(const glm::dvec3& normal, double rest, const glm::dvec2& u, LightSample& sample) const;
  [[nodiscard]] double surface_pdf(const Choices& choices, const glm::dvec3& position, const glm::dvec3& normal,
                                   std::uint32_t surface, const SurfacePoint& hit) const;
  [[nodiscard]] double environment_pdf(const Choices& choices, const glm::dvec3& position, const glm::dvec3& normal,
                                       const glm::dvec3& direction) const;

  ConstantEnvironment constant_environment_;
  LitSphere lit_;
  glm::dvec3 background_{0.0};
  std::vector<Light> punctual_;
  TriangleLights triangles_;
  std::optional<EnvironmentMap> environment_;
  std::size_t enumerated_ = 0;
  Choices all_;
  Choices sampled_;           ///< without the enumerated ones; empty when none is enumerated
  std::vector<Media> media_;  ///< of every light but the environment; none where no solid absorbs
  std::vector<double> power_sums_;
  double power_ = 0.0;
};

}  // namespace hpr
