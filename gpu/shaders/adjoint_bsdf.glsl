// How flux goes on from a surface: AdjointBsdf of rt/photons/adjoint_bsdf.h.
// Needs photon_state.glsl and what that needs.

// How far rounding takes two normals apart that are one.
const double kSameNormal = 1e-6lf;

// What passes a clear sheet goes straight on, whatever its normal.
bool is_plain_lobe(FluxArrival at, uint lobe) {
  bool bends = at.material.solid && at.material.ior != 1.0lf;
  return at.flat_normals || (lobe == kTransmission && bsdf_is_delta(at.bsdf, lobe) && !bends);
}

// The surface as an eye in `direction` meets it.
SurfacePoint seen_from(FluxArrival at, dvec3 direction) {
  SurfacePoint seen = at.surface;
  if (dot(direction, at.surface.geometric_normal) < 0.0lf) {
    return meet_surface(work.surfaces.table, at.surface.surface, at.surface.position, -direction);
  }
  seen.to_viewer = direction;
  return seen;
}

// The material as an eye sees it, of the channel of light that was chosen here.
MaterialPoint material_at(FluxArrival at, SurfacePoint seen) {
  MaterialPoint material = evaluate_material(work.materials, seen);
  material.channel = at.material.channel;
  material.channel_scale = at.material.channel_scale;
  material.ior = at.material.ior;
  return material;
}
