// How a surface scatters light at one place: Bsdf of rt/materials/bsdf.h.
// Needs plain_bsdf.glsl and what that needs.

struct Bsdf {
  PlainBsdf plain;
  bool is_extended;
};

Bsdf make_bsdf(MaterialPoint material, SurfacePoint surface, bool flux) {
  return Bsdf(make_plain_bsdf(material, surface, flux), false);
}

bool bsdf_present(Bsdf b, uint lobe) {
  return plain_present(b.plain, lobe);
}

bool bsdf_is_delta(Bsdf b, uint lobe) {
  return plain_is_delta(b.plain, lobe);
}

// f of one lobe, 1/sr, and the density of sampling that direction.
dvec3 bsdf_lobe(Bsdf b, uint lobe, dvec3 to_light, out double pdf) {
  return plain_lobe(b.plain, lobe, to_light, pdf);
}

dvec3 bsdf_value(Bsdf b, uint lobe, dvec3 to_light) {
  double pdf;
  return bsdf_lobe(b, lobe, to_light, pdf);
}

double bsdf_pdf(Bsdf b, uint lobe, dvec3 to_light) {
  double pdf;
  bsdf_lobe(b, lobe, to_light, pdf);
  return pdf;
}

Scattering bsdf_scattering(Bsdf b, dvec3 to_light) {
  return plain_scattering(b.plain, to_light);
}

// The sum over Diffuse and Reflection, a coat among that, or one of them.
dvec3 bsdf_reflected(Bsdf b, dvec3 to_light, bool diffuse, bool specular) {
  return plain_reflected(b.plain, to_light, diffuse, specular);
}

// f of all lobes.
dvec3 bsdf_total(Bsdf b, dvec3 to_light) {
  double pdf;
  return plain_reflected(b.plain, to_light, true, true) + scatter_through(b.plain, to_light, pdf);
}

// False when the lobe is absent or the sample fails.
bool bsdf_sample(Bsdf b, uint lobe, dvec2 u, out BsdfSample s) {
  return plain_sample(b.plain, lobe, u, s);
}

dvec3 bsdf_weight(Bsdf b, uint lobe) {
  return plain_weight(b.plain, lobe);
}

double bsdf_roughness(Bsdf b, uint lobe) {
  return b.plain.roughness;
}

// The normal that lights are chosen by: zero where they may shine through.
dvec3 bsdf_light_normal(Bsdf b) {
  return bsdf_present(b, kTransmission) ? dvec3(0.0lf) : b.plain.normal;
}

// Whether light is followed along the lobe rather than gathered from photons.
bool is_followed(Bsdf b, uint lobe, double glossy_cutoff) {
  if (lobe == kTransmission || lobe == kDiffuseTransmission) return true;
  return lobe != kDiffuse && (bsdf_roughness(b, lobe) < glossy_cutoff || bsdf_is_delta(b, lobe));
}
