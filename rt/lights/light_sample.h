#pragma once

#include <cstdint>
#include <glm/vec3.hpp>

#include "rt/materials/medium.h"

namespace hpr {

/// Light that would fall on a place if nothing stood between.
struct LightSample {
  glm::dvec3 to_light{0.0};   ///< unit length
  double distance = 0.0;      ///< metres, infinite for directional lights and the environment
  glm::dvec3 weight{0.0};     ///< radiance / pdf, or the irradiance on a plane that faces a light without extent, over
                              ///< the probability it was chosen with: times f and the cosine gives reflected radiance
  double pdf = 0.0;           ///< per solid angle, choice included; 0 for lights rays cannot meet
  glm::dvec3 goal{0.0};       ///< the light's place, world; meaningful at finite distance
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

}  // namespace hpr
