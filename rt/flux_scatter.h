#pragma once

#include <optional>

#include "rt/bsdf.h"
#include "rt/material_point.h"
#include "rt/sampler.h"
#include "rt/surfaces.h"
#include "scene/scene.h"

namespace hpr {

/// Where flux arrives, as its light sees the place: `surface.to_viewer` points to the light.
struct FluxArrival {
  const SurfacePoint& surface;
  const MaterialPoint& material;
  const Bsdf& bsdf;  ///< made for Carried::Flux
};

/// A direction in which a lobe sends on flux that has arrived, and what of the flux goes there over the chance to
/// choose it: the adjoint of what an eye in that direction sees of the place by the same lobe, so that photons and
/// paths agree.
///
/// Flux is counted on the true surface, while f and its cosine go by the normal that is shaded with (Veach, "Robust
/// Monte Carlo Methods for Light Transport Simulation", 1997, section 5.3.2). That one depends on the eye: a normal
/// that turns away from whoever looks gives way to a plainer one. So where it leans from the surface, directions are
/// chosen about both normals, and weighed by the normal that an eye there would shade with. Lobes of one direction and
/// those through the surface are weighed by Veach's factor alone.
///
/// None where the flux ends.
[[nodiscard]] std::optional<BsdfSample> sample_flux(const Scene& scene, const FluxArrival& at, Lobe lobe,
                                                    Sampler& sampler);

}  // namespace hpr
