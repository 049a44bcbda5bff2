// How a surface without extensions scatters light: Bsdf of rt/materials/bsdf.h, which says by what formulas.
// Needs reals.glsl, sampling.glsl, surface_point.glsl, materials.glsl and microfacets.glsl.

const uint kDiffuse = 0u;
const uint kReflection = 1u;
const uint kTransmission = 2u;
const uint kCoat = 3u;
const uint kDiffuseTransmission = 4u;
const uint kLobes = 5u;

const double kDeltaRoughness = 1e-3lf;
const double kMinWeight = 1e-3lf;
const double kMinFacetWeight = 0.1lf;
const double kWideAlpha = 0.05lf;
const double kNarrowest = kDeltaRoughness * kDeltaRoughness;
const double kEdgeOn = 1e-9lf;

struct Scattering {
  dvec3 value[5];
  double pdf[5];
};
struct BsdfSample {
  dvec3 direction;
  dvec3 weight;
  double pdf;  // 0 when the lobe has one direction only
};

struct PlainBsdf {
  dvec3 view;
  dvec3 normal;
  dvec3 geometric_normal;
  dvec3 base_color;
  dvec3 tint;
  double normal_view;
  double bounded_view;
  double view_smith;
  double roughness;
  double alpha2;
  double metallic;
  double diffuse;
  double view_enters;
  double ior;
  double ior_spread;
  double f0;
  double eta;
  double squeeze;
  bool solid;
  bool inside;
  bool flux;
  bool exact;
  bool reflects;
  bool all_mirror;
  bool scatters;
  bool channels;  // bends each channel otherwise, all in directions they have in common
};

bool shares_directions(MaterialPoint material) {
  double bends = 1.0lf - 1.0lf / max(material.ior - material.ior_spread, 1.0lf);
  return material.roughness >= kDeltaRoughness && squared(material.roughness) * bends >= kNarrowest;
}

// Sets what depends on the index of refraction.
void set_ior(inout PlainBsdf b, double ior) {
  b.ior = ior;
  b.f0 = b.all_mirror ? 1.0lf : squared((ior - 1.0lf) / (ior + 1.0lf));
  b.reflects = ior != 1.0lf;
  b.eta = 1.5lf;
  b.squeeze = 1.0lf;
  if (!b.exact || b.all_mirror) return;
  b.eta = b.solid && b.inside ? 1.0lf / ior : ior;
  if (b.solid && !b.flux) b.squeeze = 1.0lf / squared(b.eta);
}

// What transmits one channel, as set_channel() would have it, and the dielectric's Fresnel term there; no more of it is set.
PlainBsdf channel_of(PlainBsdf b, uint channel) {
  PlainBsdf only = b;
  set_ior(only, max(b.ior + (double(channel) - 1.0lf) * b.ior_spread, 1.0lf));
  only.tint = dvec3(0.0lf);
  only.tint[channel] = b.tint[channel];
  only.channels = false;
  return only;
}

double dielectric_fresnel(PlainBsdf b, double cosine) {
  if (b.all_mirror) return 1.0lf;
  if (!b.reflects) return 0.0lf;
  double c = clamp(cosine, 0.0lf, 1.0lf);
  if (b.exact) return fresnel_exact(c, b.eta);
  double m = 1.0lf - c;
  return b.f0 + (1.0lf - b.f0) * (squared(squared(m)) * m);
}

PlainBsdf make_plain_bsdf(MaterialPoint material, SurfacePoint surface, bool flux) {
  PlainBsdf b;
  b.view = surface.to_viewer;
  b.normal = material.normal;
  b.geometric_normal = surface.geometric_normal;
  b.base_color = material.base_color;
  b.tint = dvec3(0.0lf);
  b.roughness = material.roughness;
  b.alpha2 = squared(squared(material.roughness));
  b.metallic = material.metallic;
  b.solid = material.solid;
  b.inside = surface.inside;
  b.flux = flux;
  b.exact = material.transmission > 0.0lf;
  b.all_mirror = !(material.ior > 0.0lf);
  b.diffuse = (1.0lf - b.metallic) * (1.0lf - material.transmission);
  b.ior_spread = material.ior_spread;
  set_ior(b, material.ior);
  if (b.exact && !b.all_mirror) {
    dvec3 tint = (1.0lf - b.metallic) * material.transmission * (b.solid ? sqrt(b.base_color) : b.base_color);
    if (material.channel == kAllChannels) {
      b.tint = tint;
    } else {
      b.tint[material.channel] = double(material.channel_scale) * tint[material.channel];
    }
  }
  b.normal_view = dot(b.normal, b.view);
  b.scatters = !material.unlit && b.normal_view > kEdgeOn && dot(b.geometric_normal, b.view) > 0.0lf;
  b.normal_view = min(b.normal_view, 1.0lf);
  b.view_smith = sqrt(b.alpha2 + (1.0lf - b.alpha2) * squared(b.normal_view));
  b.bounded_view = b.scatters ? mirrored_bound(b.normal_view, b.alpha2) * b.normal_view : 0.0lf;
  b.view_enters = 0.0lf;
  if (b.exact && !b.all_mirror && b.diffuse > 0.0lf) {
    b.view_enters = (1.0lf - dielectric_fresnel(b, b.normal_view)) / entering(max(b.eta, 1.0lf / b.eta));
  }
  b.channels = disperses(material) && shares_directions(material);
  return b;
}

bool same_side(PlainBsdf b, dvec3 to_light) {
  return dot(b.normal, to_light) > kEdgeOn && dot(b.geometric_normal, to_light) > 0.0lf;
}

bool other_side(PlainBsdf b, dvec3 to_light) {
  return dot(b.normal, to_light) < -kEdgeOn && dot(b.geometric_normal, to_light) < 0.0lf;
}

bool refracts(PlainBsdf b) {
  return b.solid && b.eta != 1.0lf;
}

dvec3 plain_fresnel(PlainBsdf b, double cosine, double dielectric) {
  dvec3 result = dvec3((1.0lf - b.metallic) * dielectric);
  if (b.metallic > 0.0lf) result += b.metallic * (b.base_color + (1.0lf - b.base_color) * schlick_rise(cosine));
  return result;
}

// Each channel by its own index where they differ: near the critical angle one is let through that another is not.
dvec3 fresnel_of_facets(PlainBsdf b, double cosine, double dielectric) {
  dvec3 result = plain_fresnel(b, cosine, dielectric);
  if (!b.channels) return result;
  for (uint c = 0u; c < 3u; ++c) {
    result[c] += (1.0lf - b.metallic) * (dielectric_fresnel(channel_of(b, c), cosine) - dielectric);
  }
  return result;
}

double facet_distribution(PlainBsdf b, dvec3 normal) {
  // (n.h)^2 (alpha^2 - 1) + 1 without the cancellation that costs all digits of a narrow lobe.
  dvec3 across = cross(b.normal, normal);
  double spread = dot(across, across) + b.alpha2 * squared(dot(b.normal, normal));
  return b.alpha2 / (kPi * spread * spread);
}

double shadowing(PlainBsdf b, double normal_light) {
  double light_smith = sqrt(b.alpha2 + (1.0lf - b.alpha2) * squared(normal_light));
  return 0.5lf / (normal_light * b.view_smith + b.normal_view * light_smith);
}

// Directions of a microfacet lobe, reduced to what its formulas need.
struct Facet {
  double normal_light;  // |n.l|
  double view_half;     // v.h
  double light_half;    // |l.h|
  double distribution;  // D(h), 1/sr
  double stretch;       // |v + eta l|^2 for refraction
};

// False where the lobe does not scatter to.
bool make_facet(PlainBsdf b, uint lobe, dvec3 to_light, out Facet facet) {
  facet = Facet(0.0lf, 0.0lf, 0.0lf, 0.0lf, 1.0lf);
  bool through = lobe == kTransmission;
  if (!b.scatters || !(through ? other_side(b, to_light) : same_side(b, to_light))) return false;
  facet.normal_light = abs(dot(b.normal, to_light));
  dvec3 between;
  if (through && refracts(b)) {
    between = b.view + b.eta * to_light;
    facet.stretch = dot(between, between);
    between *= (dot(between, b.normal) < 0.0lf ? -1.0lf : 1.0lf) / sqrt(facet.stretch);
    facet.view_half = dot(b.view, between);
    facet.light_half = -dot(to_light, between);
  } else {
    // What goes through a rough sheet is its mirror image carried to the other side.
    between = b.view + (through ? to_light + 2.0lf * facet.normal_light * b.normal : to_light);
    double size = length(between);
    between /= size;
    facet.view_half = 0.5lf * size;
    facet.light_half = facet.view_half;
  }
  if (!(facet.view_half > 0.0lf) || !(facet.light_half > 0.0lf)) return false;
  facet.distribution = facet_distribution(b, between);
  return true;
}

// What the specular layer leaves to the diffuse lobe.
double plain_below(PlainBsdf b, dvec3 to_light, double dielectric) {
  if (!b.exact) return 1.0lf - dielectric;
  return b.view_enters * (1.0lf - dielectric_fresnel(b, dot(b.normal, to_light)));
}

// The integral that sampled normals are normalised by, times 2: of all that are visible, or of the bounded ones.
double sampled_normals(PlainBsdf b, uint lobe) {
  return 2.0lf * ((lobe == kReflection ? b.bounded_view : b.normal_view) + b.view_smith);
}

double facet_pdf(PlainBsdf b, uint lobe, Facet facet) {
  double pdf = facet.distribution / sampled_normals(b, lobe);
  if (lobe == kReflection || !refracts(b)) return pdf;
  return pdf * 4.0lf * facet.view_half * facet.light_half * squared(b.eta) / facet.stretch;
}

bool plain_present(PlainBsdf b, uint lobe) {
  if (!b.scatters || lobe >= kCoat) return false;
  if (lobe == kReflection) return b.reflects || b.metallic > 0.0lf;
  if (lobe == kTransmission) return largest(b.tint) > 0.0lf;
  return !b.all_mirror && b.diffuse * largest(b.base_color) > 0.0lf && (!b.exact || b.view_enters > 0.0lf);
}

bool plain_is_delta(PlainBsdf b, uint lobe) {
  if (lobe == kDiffuse) return false;
  if (b.roughness < kDeltaRoughness) return true;
  return lobe == kTransmission && b.solid && squared(b.roughness) * abs(b.eta - 1.0lf) < kNarrowest;
}

// Values and densities of the lobes on the viewer's side.
void scatter_back(PlainBsdf b, dvec3 to_light, out dvec3 diffuse, out dvec3 specular, out dvec2 pdf) {
  diffuse = dvec3(0.0lf);
  specular = dvec3(0.0lf);
  pdf = dvec2(0.0lf);
  if (!b.scatters || !same_side(b, to_light)) return;
  dvec3 sum = b.view + to_light;
  double size = length(sum);
  double dielectric = dielectric_fresnel(b, 0.5lf * size);
  diffuse = (b.diffuse / kPi * plain_below(b, to_light, dielectric)) * b.base_color;
  if (plain_present(b, kDiffuse)) pdf.x = dot(b.normal, to_light) / kPi;
  if (b.roughness < kDeltaRoughness) return;
  double facets = facet_distribution(b, sum / size);
  double common_factor = facets * shadowing(b, dot(b.normal, to_light));
  specular = common_factor * fresnel_of_facets(b, 0.5lf * size, dielectric);
  if (plain_present(b, kReflection)) pdf.y = facets / sampled_normals(b, kReflection);
}

// Value and density of Transmission by one channel's index, or by that of all; `pdf` is that of the lobe where it is present.
dvec3 scatter_through_as_one(PlainBsdf b, dvec3 to_light, out double pdf) {
  pdf = 0.0lf;
  if (plain_is_delta(b, kTransmission)) return dvec3(0.0lf);
  Facet facet;
  if (!make_facet(b, kTransmission, to_light, facet)) return dvec3(0.0lf);
  double fresnel = dielectric_fresnel(b, facet.view_half);
  double common_factor = facet.distribution * shadowing(b, facet.normal_light);
  dvec3 result = (common_factor * (1.0lf - fresnel)) * b.tint;
  if (refracts(b)) result *= 4.0lf * facet.view_half * facet.light_half * squared(b.eta) * b.squeeze / facet.stretch;
  // Beyond the critical angle a facet lets nothing through, and sampling fails.
  if (plain_present(b, kTransmission) && fresnel < 1.0lf) pdf = facet_pdf(b, kTransmission, facet);
  return result;
}

dvec3 scatter_through(PlainBsdf b, dvec3 to_light, out double pdf) {
  pdf = 0.0lf;
  dvec3 result = dvec3(0.0lf);
  uint count = b.channels ? 3u : 1u;
  bool is_present = plain_present(b, kTransmission);
  for (uint c = 0u; c < count; ++c) {
    PlainBsdf each = b;
    if (b.channels) each = channel_of(b, c);
    double each_pdf;
    dvec3 value = scatter_through_as_one(each, to_light, each_pdf);
    if (is_present) pdf += each_pdf;
    if (b.channels) {
      result[c] = value[c];
    } else {
      result = value;
    }
  }
  if (b.channels) pdf /= 3.0lf;
  return result;
}

// f and density of every lobe.
Scattering plain_scattering(PlainBsdf b, dvec3 to_light) {
  Scattering all;
  for (uint i = 0u; i < kLobes; ++i) {
    all.value[i] = dvec3(0.0lf);
    all.pdf[i] = 0.0lf;
  }
  dvec2 pdf;
  scatter_back(b, to_light, all.value[kDiffuse], all.value[kReflection], pdf);
  all.pdf[kDiffuse] = pdf.x;
  all.pdf[kReflection] = pdf.y;
  if (b.scatters && !same_side(b, to_light)) all.value[kTransmission] = scatter_through(b, to_light, all.pdf[kTransmission]);
  return all;
}

// f of one lobe and its density.
dvec3 plain_lobe(PlainBsdf b, uint lobe, dvec3 to_light, out double pdf) {
  pdf = 0.0lf;
  if (lobe >= kCoat) return dvec3(0.0lf);
  if (lobe == kTransmission) return scatter_through(b, to_light, pdf);
  dvec3 diffuse;
  dvec3 specular;
  dvec2 both;
  scatter_back(b, to_light, diffuse, specular, both);
  pdf = lobe == kDiffuse ? both.x : both.y;
  return lobe == kDiffuse ? diffuse : specular;
}

dvec3 plain_reflected(PlainBsdf b, dvec3 to_light, bool diffuse, bool specular) {
  dvec3 diffuse_value;
  dvec3 specular_value;
  dvec2 pdf;
  scatter_back(b, to_light, diffuse_value, specular_value, pdf);
  return (diffuse ? diffuse_value : dvec3(0.0lf)) + (specular ? specular_value : dvec3(0.0lf));
}

// The root mean square of what the facets that the viewer sees reflect, or let through.
double facet_fraction(PlainBsdf b, uint lobe) {
  const double kDiagonal = 0.70710678118654752440lf;
  double alpha = squared(b.roughness);
  dvec3 view = dvec3(sqrt(max(0.0lf, 1.0lf - squared(b.normal_view))), 0.0lf, b.normal_view);
  double sum = 0.0lf;
  for (uint i = 0u; i < 8u; ++i) {
    double fraction = 0.125lf + 0.25lf * double(i >> 1);
    dvec2 around = dvec2((i & 1u) == 0u ? kDiagonal : -kDiagonal, kDiagonal);
    double reflected = dielectric_fresnel(b, dot(view, visible_normal(view, dvec2(alpha), 1.0lf, fraction, around)));
    sum += squared(lobe == kReflection ? reflected : 1.0lf - reflected);
  }
  double least = max(kMinFacetWeight * min(alpha / kWideAlpha, 1.0lf), kMinWeight);
  return max(sqrt(sum / 8.0lf), least);
}

dvec3 plain_weight(PlainBsdf b, uint lobe) {
  if (!plain_present(b, lobe)) return dvec3(0.0lf);
  bool single = plain_is_delta(b, lobe);
  if (lobe == kDiffuse) return (b.diffuse * (b.exact ? b.view_enters : max(1.0lf - b.f0, kMinWeight))) * b.base_color;
  double straight = dielectric_fresnel(b, b.normal_view);
  double fraction = b.exact && !single || lobe == kTransmission && !single ? facet_fraction(b, lobe) : 0.0lf;
  if (lobe == kTransmission) return (single ? (1.0lf - straight) * b.squeeze : fraction) * b.tint;
  if (b.exact && !single) return plain_fresnel(b, b.normal_view, fraction);
  dvec3 reflected = plain_fresnel(b, b.normal_view, straight);
  return single ? reflected : max(reflected, kMinWeight);
}

// The viewer's direction refracted at facets of `normal`; false where all is reflected.
bool refracted(PlainBsdf b, dvec3 normal, out dvec3 direction) {
  direction = dvec3(0.0lf);
  double cosine = dot(b.view, normal);
  double sine2 = max(0.0lf, 1.0lf - squared(cosine)) / squared(b.eta);
  if (!(sine2 < 1.0lf)) return false;
  direction = normalize((cosine / b.eta - sqrt(1.0lf - sine2)) * normal - b.view / b.eta);
  return true;
}

bool sample_facet(PlainBsdf b, uint lobe, dvec2 u, out BsdfSample s) {
  s = BsdfSample(dvec3(0.0lf), dvec3(0.0lf), 0.0lf);
  dmat3 frame = basis_about(b.normal);
  double bound = lobe == kReflection ? b.bounded_view / b.normal_view : 1.0lf;
  dvec3 between = frame * visible_normal(b.view * frame, dvec2(squared(b.roughness)), bound, u.x, on_circle(u.y));
  dvec3 reflected = 2.0lf * dot(b.view, between) * between - b.view;
  if (lobe == kReflection) {
    s.direction = normalize(reflected);
  } else if (refracts(b)) {
    if (!refracted(b, between, s.direction)) return false;
  } else {
    double height = dot(reflected, b.normal);
    if (!(height > 0.0lf)) return false;
    s.direction = normalize(reflected - 2.0lf * height * b.normal);
  }
  Facet facet;
  if (!make_facet(b, lobe, s.direction, facet)) return false;
  s.pdf = facet_pdf(b, lobe, facet);
  if (!(s.pdf > 0.0lf) || isinf(s.pdf)) return false;
  // f cos / pdf is Fresnel's term times G2 / G1, in a form that holds at grazing angles.
  double kept = sampled_normals(b, lobe) * facet.normal_light * shadowing(b, facet.normal_light);
  double fresnel = dielectric_fresnel(b, facet.view_half);
  s.weight = lobe == kReflection ? kept * fresnel_of_facets(b, facet.view_half, fresnel)
                                 : (kept * (1.0lf - fresnel) * (refracts(b) ? b.squeeze : 1.0lf)) * b.tint;
  return true;
}

bool sample_single(PlainBsdf b, uint lobe, out BsdfSample s) {
  double fresnel = dielectric_fresnel(b, b.normal_view);
  s = BsdfSample(dvec3(0.0lf), dvec3(0.0lf), 0.0lf);
  s.weight = lobe == kReflection ? plain_fresnel(b, b.normal_view, fresnel) : ((1.0lf - fresnel) * b.squeeze) * b.tint;
  if (!(largest(s.weight) > 0.0lf)) return false;
  if (lobe == kReflection) {
    s.direction = 2.0lf * b.normal_view * b.normal - b.view;
  } else if (refracts(b)) {
    if (!refracted(b, b.normal, s.direction)) return false;
  } else {
    s.direction = -b.view;
    return true;
  }
  double height = dot(s.direction, b.geometric_normal);
  if (lobe == kReflection ? height < 0.0lf : height > 0.0lf) s.direction -= 2.0lf * height * b.geometric_normal;
  s.direction = normalize(s.direction);
  return true;
}

bool plain_sample(PlainBsdf b, uint lobe, dvec2 u, out BsdfSample s) {
  s = BsdfSample(dvec3(0.0lf), dvec3(0.0lf), 0.0lf);
  if (!plain_present(b, lobe)) return false;
  if (lobe == kDiffuse) {
    s.direction = cosine_lobe(b.normal, u);
    if (!same_side(b, s.direction)) return false;
    s.pdf = dot(b.normal, s.direction) / kPi;
    s.weight = kPi * plain_reflected(b, s.direction, true, false);
    return true;
  }
  // A direction by one channel's lobe, for all channels (Wilkie, Nawaz, Droske, Weidlich, Hanika 2014).
  PlainBsdf by = b;
  bool by_channel = lobe == kTransmission && b.channels;
  if (by_channel) {
    double channel = min(floor(3.0lf * u.x), 2.0lf);
    by = channel_of(b, uint(channel));
    u.x = 3.0lf * u.x - channel;
    if (!plain_present(by, lobe)) return false;
  }
  bool found = plain_is_delta(by, lobe) ? sample_single(by, lobe, s) : sample_facet(by, lobe, u, s);
  if (!found || !by_channel) return found;
  dvec3 value = scatter_through(b, s.direction, s.pdf);
  s.weight = (abs(dot(b.normal, s.direction)) / s.pdf) * value;
  return true;
}
