// Needs bsdf.glsl, reflection_terms.glsl.

// Bsdf::reflection_terms() of the lobes that photons light.
ReflectionTerms gathered_terms(Bsdf bsdf, double glossy_cutoff) {
  PlainBsdf b = bsdf.plain;
  bool diffuse = bsdf_present(bsdf, kDiffuse) && !is_followed(bsdf, kDiffuse, glossy_cutoff);
  bool specular = bsdf_present(bsdf, kReflection) && !is_followed(bsdf, kReflection, glossy_cutoff);
  ReflectionTerms terms = ReflectionTerms(vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), 0.0, 0.0, 1.0, 1.0, 0.0, 0.0,
                                          0.0, 0.0, false);
  if (!b.scatters) return terms;
  terms.view = vec3(b.view);
  terms.normal = vec3(b.normal);
  terms.geometric_normal = vec3(b.geometric_normal);
  if (diffuse) terms.diffuse = vec3((b.diffuse / kPi * (b.exact ? b.view_enters : 1.0lf)) * b.base_color);
  terms.tint = vec3(b.metallic * b.base_color);
  terms.edge_on = float(kEdgeOn);
  terms.normal_view = float(b.normal_view);
  terms.view_smith = float(b.view_smith);
  terms.alpha2 = float(b.alpha2);
  terms.metallic = float(b.metallic);
  if (b.all_mirror || b.reflects) {
    terms.f0 = b.all_mirror ? 1.0 : float(b.f0);
    terms.rise = 1.0 - terms.f0;
  }
  if (b.exact && b.reflects && !b.all_mirror) terms.eta = float(b.eta);
  terms.specular = specular && b.roughness >= kDeltaRoughness;
  return terms;
}
