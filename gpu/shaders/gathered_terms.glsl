// Photons at surfaces of all kinds. Needs bsdf.glsl, reflection_terms.glsl, photons.glsl.

// Bsdf::reflection_terms() of the lobes that photons light.
ReflectionTerms gathered_terms(Bsdf bsdf, double glossy_cutoff) {
  PlainBsdf b = bsdf.plain;
  bool diffuse = takes_photons(bsdf, kDiffuse, glossy_cutoff);
  bool specular = takes_photons(bsdf, kReflection, glossy_cutoff);
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

// As reflect_photons_by_lobes() of rt/photons/photon_query.cpp: by the lobes of a surface with extensions that no ray follows.
dvec3 gather_by_lobes(PhotonMap map, double radius, SurfacePoint surface, Bsdf bsdf, uint lobes, dvec3 shading_normal, inout bool done) {
  const double kGrazing = 1e-3lf;
  PhotonSearch search = search_photons(map, surface.position, surface.geometric_normal, surface.layer, radius);
  dvec3 sum = dvec3(0.0lf);
  while (next_photon(map, search)) {
    PhotonLight light = map.lights.lights[search.index];
    dvec3 direction = dvec3(photon_direction(light.direction));
    double falls = dot(direction, surface.geometric_normal);
    if (!(falls > 0.0lf)) continue;
    double cosine = dot(direction, shading_normal) / max(falls, kGrazing);
    sum += (double(search.weight) * cosine) * bsdf_sum(bsdf, lobes, direction) * dvec3(light.flux);
  }
  done = done && search_is_done(search);
  dvec3 light = photon_density(map, radius) * sum;
  return is_finite(light.r + light.g + light.b) ? light : dvec3(0.0lf);
}

// What photons bring to a surface, by the lobes that are not followed for themselves.
dvec3 gathered_light(PhotonMaps photons, PhotonUse use, SurfacePoint surface, Bsdf bsdf, dvec3 shading_normal, double glossy_cutoff,
                     inout bool done) {
  if (!is_extended(bsdf)) {
    return light_by_photons(photons, use, surface, gathered_terms(bsdf, glossy_cutoff), shading_normal, done);
  }
  uint lobes = 0u;
  for (uint lobe = 0u; lobe < kLobes; ++lobe) {
    if (takes_photons(bsdf, lobe, glossy_cutoff)) lobes |= 1u << lobe;
  }
  dvec3 light = dvec3(0.0lf);
  if (lobes == 0u) return light;
  uint i = 0u;
  for (; i < use.maps; ++i) {
    light += gather_by_lobes(photons.maps[i], use.radius[i], surface, bsdf, lobes, shading_normal, done);
  }
  done = done && i == use.maps;
  return light;
}
