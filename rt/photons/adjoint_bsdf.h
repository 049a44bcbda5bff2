#pragma once

#include <array>
#include <cstddef>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>

#include "rt/materials/bsdf.h"
#include "rt/materials/material_point.h"
#include "rt/sampling/sampler.h"
#include "rt/trace/surfaces.h"
#include "scene/scene.h"

namespace hpr {

/// Where flux arrives, as its light sees the place: `surface.to_viewer` points to the light.
struct FluxArrival {
  const SurfacePoint& surface;
  const MaterialPoint& material;
  const Bsdf& bsdf;               ///< made for Carried::Flux
  const WorldTriangle& triangle;  ///< that the place lies on
};

/// An eye's ray that ends at the light, and what of the flux goes back along it.
struct FluxDirection {
  glm::dvec3 direction{0.0};
  glm::dvec3 weight{0.0};
};

/// How flux goes on from a place: the adjoint of what eyes see of it by the same lobes, so that photons and paths
/// agree.
///
/// Flux is counted on the true surface, while f and its cosine go by the normal that is shaded with (Veach, "Robust
/// Monte Carlo Methods for Light Transport Simulation", 1997, section 5.3.2). That one depends on the eye: a normal
/// that turns away from whoever looks gives way to a plainer one. So where it leans from the surface, directions are
/// chosen about both normals, and weighed by the normal that an eye there would shade with. A lobe of one direction may
/// send light of several eyes' rays to one lamp: those that Bsdf::sample puts back on their side meet others. One is
/// chosen.
class AdjointBsdf {
 public:
  /// All must outlive this.
  AdjointBsdf(const Scene& scene, const Surfaces& surfaces, const FluxArrival& at);

  /// About the share of the flux that the lobe sends on: for choosing among lobes. Zero only where it sends none.
  [[nodiscard]] glm::dvec3 weight(Lobe lobe) const;
  /// How many times as much a surface of the normals that eyes shade with would catch of this light as the true one
  /// does: so much of the weight of sample() is none of a lobe's. At least 1.
  [[nodiscard]] double gain() const;
  /// A direction, and what of the flux goes there over the chance to choose it. None where the flux ends.
  [[nodiscard]] std::optional<BsdfSample> sample(Lobe lobe, Sampler& sampler) const;

 private:
  /// Of a lobe of one direction.
  struct Directions {
    std::array<FluxDirection, 8> all;
    std::size_t count = 0;
    glm::dvec3 sum{0.0};
  };

  [[nodiscard]] bool is_plain(Lobe lobe) const;
  [[nodiscard]] const Directions& directions(Lobe lobe) const {
    return lobe == Lobe::Coat ? *coat_directions_ : directions_[lobe == Lobe::Transmission ? 1 : 0];
  }
  [[nodiscard]] Directions find_directions(Lobe lobe) const;
  [[nodiscard]] FluxDirection direction_by(Lobe lobe, const glm::dvec3& arrived, const glm::dvec3& normal,
                                           std::optional<double> eta) const;
  [[nodiscard]] MaterialPoint material_at(const SurfacePoint& seen) const;
  [[nodiscard]] glm::dvec3 normal_of(Lobe lobe, const SurfacePoint& seen) const;
  [[nodiscard]] SurfacePoint seen_from(const glm::dvec3& direction) const;
  [[nodiscard]] glm::dvec3 scattered(Lobe lobe, const glm::dvec3& direction) const;
  [[nodiscard]] std::optional<BsdfSample> sample_wide(Lobe lobe, Sampler& sampler) const;
  [[nodiscard]] std::optional<BsdfSample> sample_direction(const Directions& directions, Sampler& sampler) const;

  const Scene& scene_;
  const Surfaces& surfaces_;
  const FluxArrival& at_;
  bool flat_;   ///< every eye shades by the true surface's normal
  Bsdf plain_;  ///< by that normal; only where it is not flat
  std::array<Directions, 2> directions_;
  std::unique_ptr<const Directions> coat_directions_;  ///< null without a clear coat
};

}  // namespace hpr
