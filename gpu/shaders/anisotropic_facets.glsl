// White facets of a GGX distribution that is wider along one tangent than across it: rt/materials/anisotropic_facets.h.
// Needs reals.glsl, sampling.glsl and microfacets.glsl.

struct AnisotropicFacets {
  dmat3 frame;  // tangent, across it, normal
  dvec3 view;   // in that frame
  double along;
  double across;
  double view_stretched;
  double bound;
};

double anisotropic_stretched(AnisotropicFacets f, dvec3 local) {
  return sqrt(squared(f.along * local.x) + squared(f.across * local.y) + squared(local.z));
}

AnisotropicFacets make_anisotropic_facets(dvec3 view, dvec3 normal, dvec3 tangent, double along, double across) {
  AnisotropicFacets f;
  f.frame = dmat3(tangent, cross(normal, tangent), normal);
  f.view = view * f.frame;
  f.along = along;
  f.across = across;
  f.view_stretched = anisotropic_stretched(f, f.view);
  f.bound = mirrored_bound(min(f.view.z, 1.0lf), squared(min(along, across)));
  return f;
}

// f, less Fresnel's term, and the density of sampling that direction.
double anisotropic_value(AnisotropicFacets f, dvec3 to_light, out double pdf) {
  dvec3 light = to_light * f.frame;
  dvec3 between = normalize(f.view + light);
  double spread = squared(between.x / f.along) + squared(between.y / f.across) + squared(between.z);
  double facets = 1.0lf / (kPi * f.along * f.across * spread * spread);
  pdf = facets / (2.0lf * (f.bound * f.view.z + f.view_stretched));
  return 0.5lf * facets / (light.z * f.view_stretched + f.view.z * anisotropic_stretched(f, light));
}

// False below the surface.
bool anisotropic_sample(AnisotropicFacets f, dvec2 u, out dvec3 direction) {
  dvec3 between = visible_normal(f.view, dvec2(f.along, f.across), f.bound, u.x, on_circle(u.y));
  dvec3 light = 2.0lf * dot(f.view, between) * between - f.view;
  direction = normalize(f.frame * light);
  return light.z > 0.0lf;
}
