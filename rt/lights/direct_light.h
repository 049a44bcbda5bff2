#pragma once

#include <cstddef>

#include "rt/passes/pass.h"

namespace hpr {

/// Lights are sampled so many at a time: the memory of a tile's samples does not grow with the scene's lights.
inline constexpr std::size_t kLightsAtOnce = 8;

/// Adds what the points of `wave` emit to the pixels' sums. A surface reached by a ray that chance aimed might have
/// been found by sampling lights as well: both share its light by the balance heuristic (Veach 1997, section 9.2.2).
void add_emission(const LightContext& context, const Wavefront& wave, PixelSums& sums);

/// The share of light found along a ray of density `pdf` that is left to it where sampling lights finds it too.
[[nodiscard]] double balance_heuristic(const LightContext& context, double pdf, double light_pdf);

/// Samples all lights for the points of a wave, a handful after the other.
class DirectLight {
 public:
  DirectLight(const LightContext& context, Wavefront& wave) : context_(context), wave_(wave) {}

  /// Replaces the samples of the wave by those of the next lights: what each would add if nothing stood in its way.
  /// False when all lights were sampled.
  [[nodiscard]] bool sample_next();

 private:
  void sample_enumerated();
  void sample_others();
  void add(std::uint32_t point, const LightSample& light);
  /// f of all lobes, less what rays that follow them are left with.
  [[nodiscard]] glm::dvec3 shared_scattering(const PathVertex& point, const LightSample& light) const;

  const LightContext& context_;
  Wavefront& wave_;
  std::size_t light_ = 0;
  int round_ = 0;
};

/// Adds the samples, as far as they are visible, to the pixels' sums.
void add_samples(const Wavefront& wave, PixelSums& sums);

}  // namespace hpr
