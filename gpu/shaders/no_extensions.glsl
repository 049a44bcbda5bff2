// What bsdf.glsl needs of surfaces with extensions, where there are none.

struct Bsdf {
  PlainBsdf plain;
};

Bsdf make_extended_bsdf(MaterialPoint material, SurfacePoint surface, bool flux) {
  return Bsdf(make_plain_bsdf(material, surface, flux));
}

bool is_extended(Bsdf b) {
  return false;
}

bool extended_present(Bsdf b, uint lobe) {
  return false;
}

bool extended_is_delta(Bsdf b, uint lobe) {
  return false;
}

dvec3 extended_lobe(Bsdf b, uint lobe, dvec3 to_light, out double pdf) {
  pdf = 0.0lf;
  return dvec3(0.0lf);
}

bool extended_sample(Bsdf b, uint lobe, dvec2 u, out BsdfSample s) {
  return false;
}

dvec3 extended_weight(Bsdf b, uint lobe) {
  return dvec3(0.0lf);
}

double coat_roughness(Bsdf b) {
  return 0.0lf;
}
