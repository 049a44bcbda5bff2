#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "rt/materials/medium.h"
#include "scene/scene.h"
#include "scene/view.h"

namespace hpr {

/// Light that would fall on a place if nothing stood between.
struct LightSample {
  glm::dvec3 to_light{0.0};   ///< unit length
  double distance = 0.0;      ///< metres, infinite for directional lights and the environment
  glm::dvec3 weight{0.0};     ///< radiance / pdf, or the irradiance on a plane that faces a light without extent, over
                              ///< the probability it was chosen with: times f and the cosine gives reflected radiance
  double pdf = 0.0;           ///< per solid angle, choice included; 0 for lights rays cannot meet
  glm::dvec3 goal{0.0};       ///< the light's place, world; meaningful at finite distance
  double offset = 0.0;        ///< metres before the goal in which its own surface may be met
  bool casts_shadows = true;  ///< false: nothing can stand between (the headlight)
};

/// A photon on its way.
struct PhotonStart {
  glm::dvec3 origin{0.0};               ///< world
  glm::dvec3 direction{0.0};            ///< unit length
  glm::dvec3 flux{0.0};                 ///< of one photon of one: divide by how many are sent
  std::uint32_t surface = 0xFFFFFFFFU;  ///< that emits it, if any
  double offset = 0.0;                  ///< metres to leave the emitting surface by
  glm::dvec3 center{0.0};               ///< of a light with a range, world
  double range = 0.0;                   ///< metres from there at which its light ends, see range_window; 0: nowhere
  Media media = {};                     ///< what it starts in
  bool endless = false;                 ///< it comes from without the scene: any origin before that would do
};

/// A sphere about everything a light from outside can fall on.
struct LitSphere {
  glm::dvec3 center{0.0};
  double radius = 0.0;
};

/// The window that brings a light to zero at its range, as KHR_lights_punctual recommends; 1 for a range of 0.
[[nodiscard]] double range_window(double distance, double range);

/// KHR_lights_punctual: W/sr over the squared distance (point, spot), windowed by the range; W/m^2 (directional); the
/// spot's ramp is the squared one the extension recommends. Lights with a radius are spheres, sampled over the cone
/// they are seen in (Shirley, Wang, Zimmerman, "Monte Carlo Techniques for Direct Lighting Calculations", 1996); range
/// and ramp then hold for the distance to the centre and the direction to the sampled point. Directional lights with an
/// angular radius are discs of uniform radiance in the sky that give their W/m^2 to a plane that faces the middle.
/// `u` = 0 samples the middle. The weight is zero where a light does not reach, on the very place of a light without
/// radius, and inside of one with a radius: it shines outwards only.
[[nodiscard]] LightSample sample_punctual(const Light& light, const glm::dvec3& position, const View& view,
                                          const glm::dvec2& u);

/// Whether every sample of it is the same.
[[nodiscard]] bool is_fixed(const Light& light);

/// Watts. Directional lights: through the disc the sphere shows them. The range limits no power, as it has no physical
/// meaning. 0 for a headlight.
[[nodiscard]] glm::dvec3 power_of(const Light& light, const LitSphere& lit);

/// A photon of a light that is no headlight; its flux is the light's power, before its range takes any. Photons of
/// directional lights start on a disc at the sphere's side. `u_place` is used by lights with an extent, and by
/// directional ones.
[[nodiscard]] PhotonStart emit_punctual(const Light& light, const LitSphere& lit, const glm::dvec2& u_place,
                                        const glm::dvec2& u_direction);

/// A photon that crosses the sphere along `direction`.
[[nodiscard]] PhotonStart emit_from_outside(const LitSphere& lit, const glm::dvec3& direction, const glm::dvec3& flux,
                                            const glm::dvec2& u_place);

/// One light under which a white wall that faces the eye has a radiance of about 0.9.
[[nodiscard]] Light make_headlight();

}  // namespace hpr
