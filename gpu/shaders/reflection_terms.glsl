// Reflection in single precision, for many directions of light: ReflectionTerms of rt/materials/bsdf.h, in the steps of reflect()
// in rt/photons/photon_query.cpp.

struct ReflectionTerms {
  vec3 view;
  vec3 normal;
  vec3 geometric_normal;
  vec3 diffuse;  // of the base, 1/sr, before Fresnel's term
  vec3 tint;     // of the metal, its share included
  float edge_on;  // cosines to the normal up to here are none
  float normal_view;
  float view_smith;
  float alpha2;
  float metallic;
  float f0;  // of the dielectric, whose Schlick term is f0 + rise (1 - v.h)^5
  float rise;
  float eta;  // its index where Fresnel's own equations hold, else 0
  bool specular;
};

// Quotients and roots of shaders may be some units off in single precision. Rounded from double both are the CPU's, which matters
// where a direction decides on which side of a surface light is, and in narrow lobes.
precise float exact_quotient(float a, float b) {
  precise float quotient = float(double(a) / double(b));
  return quotient;
}

precise float exact_root(float x) {
  precise float root = float(sqrt(double(x)));
  return root;
}

precise float exact_dot(vec3 a, vec3 b) {
  precise float sum = (a.x * b.x + a.y * b.y) + a.z * b.z;
  return sum;
}

precise vec3 exact_unit(vec3 v) {
  precise vec3 unit = v * exact_quotient(1.0, exact_root(exact_dot(v, v)));
  return unit;
}

precise float fresnel_in_single(float cosine, float eta) {
  // Exact, as the differences below may be small.
  precise float sine2 = (1.0 - cosine * cosine) * exact_quotient(1.0, eta * eta);
  if (!(sine2 < 1.0)) return 1.0;
  precise float refracted = exact_root(1.0 - sine2);
  precise float parallel = (eta * cosine - refracted) / (eta * cosine + refracted);
  precise float perpendicular = (cosine - eta * refracted) / (cosine + eta * refracted);
  precise float both = 0.5 * (parallel * parallel + perpendicular * perpendicular);
  return both;
}

// f of light from a direction of unit length. Where the shading normal `leans`, of light that falls on the true surface as if it
// fell on the one that normal pretends.
precise vec3 reflected_by_terms(ReflectionTerms terms, bool leans, vec3 light) {
  const float kGrazing = 1e-3;  // cosines to the true surface count as this much at the least
  precise float normal_light = exact_dot(light, terms.normal);
  precise float falls = exact_dot(light, terms.geometric_normal);
  if (!(normal_light > terms.edge_on && falls > 0.0)) return vec3(0.0);
  precise vec3 sum = light + terms.view;
  precise float length_of_sum = exact_root(exact_dot(sum, sum));
  precise float half_cosine = min(0.5 * length_of_sum, 1.0);
  precise float m = 1.0 - half_cosine;
  precise float m2 = m * m;
  precise float m5 = m2 * m2 * m;
  precise float dielectric = terms.f0 + terms.rise * m5;
  precise float below = 1.0 - dielectric;
  if (terms.eta > 0.0) {
    dielectric = fresnel_in_single(half_cosine, terms.eta);
    below = 1.0 - fresnel_in_single(min(normal_light, 1.0), terms.eta);
  }
  precise float scale = leans ? normal_light / max(falls, kGrazing) : 1.0;
  precise vec3 result = (scale * below) * terms.diffuse;
  if (!terms.specular) return result;

  precise vec3 facet = sum * exact_quotient(1.0, length_of_sum);
  vec3 n = terms.normal;
  precise vec3 across = vec3(n.y * facet.z - n.z * facet.y, n.z * facet.x - n.x * facet.z, n.x * facet.y - n.y * facet.x);
  precise float along = exact_dot(facet, n);
  precise float spread = exact_dot(across, across) + terms.alpha2 * (along * along);
  precise float light_smith = sqrt(terms.alpha2 + (1.0 - terms.alpha2) * (normal_light * normal_light));
  precise float smith = normal_light * terms.view_smith + terms.normal_view * light_smith;
  // D is divided twice, as the square of a narrow lobe's spread may be too small for a float.
  precise float distribution = terms.alpha2 / spread / spread;
  precise float facets = scale * (distribution * float(0.5lf / 3.14159265358979323846lf) / smith);
  precise float grey = facets * ((1.0 - terms.metallic) * dielectric + terms.metallic * m5);
  precise float tinted = facets * (1.0 - m5);
  result = result + tinted * terms.tint + grey;
  return result;
}
