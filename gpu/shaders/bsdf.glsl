// How a surface scatters light at one place: Bsdf of rt/materials/bsdf.h.
// Needs extended_bsdf.glsl and what that needs.

Bsdf make_bsdf(MaterialPoint material, SurfacePoint surface, bool flux) {
  return make_extended_bsdf(material, surface, flux);
}

bool bsdf_present(Bsdf b, uint lobe) {
  return is_extended(b) ? extended_present(b, lobe) : plain_present(b.plain, lobe);
}

bool bsdf_is_delta(Bsdf b, uint lobe) {
  return is_extended(b) ? extended_is_delta(b, lobe) : plain_is_delta(b.plain, lobe);
}

// f and density of every lobe.
Scattering bsdf_scattering(Bsdf b, dvec3 to_light) {
  if (!is_extended(b)) return plain_scattering(b.plain, to_light);
  Scattering all;
  for (uint i = 0u; i < kLobes; ++i) {
    double pdf;
    all.value[i] = extended_lobe(b, i, to_light, pdf);
    all.pdf[i] = pdf;
  }
  return all;
}

// The sum of f over the lobes whose bits `lobes` has.
dvec3 bsdf_sum(Bsdf b, uint lobes, dvec3 to_light) {
  dvec3 sum = dvec3(0.0lf);
  if (!is_extended(b)) {
    Scattering all = plain_scattering(b.plain, to_light);
    for (uint i = 0u; i < kCoat; ++i) sum += ((lobes >> i) & 1u) != 0u ? all.value[i] : dvec3(0.0lf);
    return sum;
  }
  for (uint i = 0u; i < kLobes; ++i) {
    double pdf;
    if (((lobes >> i) & 1u) != 0u) sum += extended_lobe(b, i, to_light, pdf);
  }
  return sum;
}

// f of all lobes.
dvec3 bsdf_total(Bsdf b, dvec3 to_light) {
  return bsdf_sum(b, (1u << kLobes) - 1u, to_light);
}

// False when the lobe is absent or the sample fails.
bool bsdf_sample(Bsdf b, uint lobe, dvec2 u, out BsdfSample s) {
  if (is_extended(b)) return extended_sample(b, lobe, u, s);
  return plain_sample(b.plain, lobe, u, s);
}

dvec3 bsdf_weight(Bsdf b, uint lobe) {
  return is_extended(b) ? extended_weight(b, lobe) : plain_weight(b.plain, lobe);
}

double bsdf_roughness(Bsdf b, uint lobe) {
  return is_extended(b) && lobe == kCoat ? coat_roughness(b) : b.plain.roughness;
}

// The normal that lights are chosen by: zero where they may shine through.
dvec3 bsdf_light_normal(Bsdf b) {
  bool shines = bsdf_present(b, kTransmission) || bsdf_present(b, kDiffuseTransmission);
  return shines ? dvec3(0.0lf) : b.plain.normal;
}

// Whether light is followed along the lobe rather than gathered from photons.
bool is_followed(Bsdf b, uint lobe, double glossy_cutoff) {
  if (lobe == kTransmission || lobe == kDiffuseTransmission) return true;
  return lobe != kDiffuse && (bsdf_roughness(b, lobe) < glossy_cutoff || bsdf_is_delta(b, lobe));
}

// Whether photons light the lobe.
bool takes_photons(Bsdf b, uint lobe, double glossy_cutoff) {
  return bsdf_present(b, lobe) && !is_followed(b, lobe, glossy_cutoff);
}
