// What all microfacet lobes are made of: rt/materials/microfacets.h, which cites the papers.
// Needs reals.glsl.

// The part of a view's cosine that the sphere of directions is cut below, so that few facets that it shows mirror it into the
// surface.
double mirrored_bound(double normal_view, double alpha2) {
  double reach2 = squared(1.0lf + sqrt(max(0.0lf, 1.0lf - squared(normal_view))));
  return (1.0lf - alpha2) * reach2 / (reach2 + alpha2 * squared(normal_view));
}

// A normal of GGX facets of these alphas along x and y that `view` sees, both around z: `fraction` of the cap's depth down,
// `around` on its circle.
dvec3 visible_normal(dvec3 view, dvec2 alpha, double bound, double fraction, dvec2 around) {
  dvec3 stretched = normalize(dvec3(alpha.x * view.x, alpha.y * view.y, view.z));
  double depth = bound * stretched.z;
  double z = 1.0lf - fraction * (1.0lf + depth);
  dvec2 across = sqrt(max(0.0lf, 1.0lf - z * z)) * around;
  dvec3 sum = dvec3(across + stretched.xy, z + stretched.z);
  dvec3 normal = dvec3(alpha * sum.xy, max(0.0lf, sum.z));
  double size = length(normal);
  return size > 0.0lf ? normal / size : dvec3(0.0lf, 0.0lf, 1.0lf);
}

// Fresnel's equations for unpolarised light that comes in `cosine` off the normal; 1 where nothing gets through.
double fresnel_exact(double cosine, double eta) {
  double sine2 = (1.0lf - cosine * cosine) / (eta * eta);
  if (!(sine2 < 1.0lf)) return 1.0lf;
  double refracted = sqrt(1.0lf - sine2);
  double parallel = (eta * cosine - refracted) / (eta * cosine + refracted);
  double perpendicular = (cosine - eta * refracted) / (cosine + eta * refracted);
  return 0.5lf * (squared(parallel) + squared(perpendicular));
}

// The part of even light from all sides that enters a medium of a higher index, relative to its own.
double entering(double index) {
  if (!(index > 1.01lf)) return 1.0lf;
  double n = min(index, 1e4lf);
  double n2 = squared(n);
  double n4 = squared(n2);
  double reflected = 0.5lf + (n - 1.0lf) * (3.0lf * n + 1.0lf) / (6.0lf * squared(n + 1.0lf)) +
                     n2 * squared((n2 - 1.0lf) / (n2 + 1.0lf)) / (n2 + 1.0lf) * logarithm_of((n - 1.0lf) / (n + 1.0lf)) -
                     2.0lf * n * n2 * (n2 + 2.0lf * n - 1.0lf) / ((n2 + 1.0lf) * (n4 - 1.0lf)) +
                     8.0lf * n4 * (n4 + 1.0lf) / ((n2 + 1.0lf) * squared(n4 - 1.0lf)) * logarithm_of(n);
  return 1.0lf - reflected;
}
