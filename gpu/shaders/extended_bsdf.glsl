// How a surface with material extensions scatters: ExtendedBsdf of rt/materials/extended_bsdf.h.
// Needs plain_bsdf.glsl and what that needs, sheen.glsl, thin_film.glsl and anisotropic_facets.glsl.

const double kInversePi = 0.31830988618379067154lf;
const double kMinAnisotropicAlpha = 1e-4lf;

struct Bsdf {
  PlainBsdf plain;  // the material without extensions
  bool extended;    // what follows counts
  ExtensionPoint extensions;
  bool anisotropic;
  dvec3 tangent;  // of anisotropic facets
  double diffuse;
  double through;
  double view_enters;
  double view_below_sheen;
  double sheen_chance;
};

bool is_extended(Bsdf b) {
  return b.extended;
}

double coat_roughness(Bsdf b) {
  return b.extensions.clearcoat_roughness;
}

// Facets as rough, all reflecting.
PlainBsdf white_facets(Bsdf b) {
  PlainBsdf facets = b.plain;
  facets.base_color = dvec3(1.0lf);
  facets.tint = dvec3(0.0lf);
  facets.metallic = 1.0lf;
  facets.diffuse = 0.0lf;
  facets.solid = false;
  facets.exact = false;
  facets.all_mirror = false;
  facets.channels = false;
  set_ior(facets, 1.5lf);
  return facets;
}

// The coat, of full strength.
PlainBsdf coat_bsdf(Bsdf b) {
  MaterialPoint coat = plain_material();
  coat.base_color = dvec3(0.0lf);
  coat.roughness = b.extensions.clearcoat_roughness;
  coat.normal = b.extensions.clearcoat_normal;
  SurfacePoint surface;
  surface.to_viewer = b.plain.view;
  surface.geometric_normal = b.plain.geometric_normal;
  surface.inside = b.plain.inside;
  return make_plain_bsdf(coat, surface, false);
}

AnisotropicFacets anisotropic_facets(Bsdf b) {
  double across = max(squared(b.plain.roughness), kMinAnisotropicAlpha);
  double along = across + (1.0lf - across) * squared(b.extensions.anisotropy);
  return make_anisotropic_facets(b.plain.view, b.plain.normal, b.tangent, along, across);
}

// Whether a direction leads into the solid that the surface bounds.
bool is_within(Bsdf b, dvec3 direction) {
  return b.plain.solid && (dot(b.plain.geometric_normal, direction) > 0.0lf) == b.plain.inside;
}

bool is_exact(Bsdf b) {
  return b.plain.exact && !b.plain.all_mirror;
}

double index_behind(Bsdf b) {
  return b.plain.solid && b.plain.inside ? 1.0lf / b.plain.ior : b.plain.ior;
}

dvec3 with_film(Bsdf b, dvec3 term, double cosine, dvec3 base_f0) {
  dvec3 film = thin_film_fresnel(cosine, b.extensions.iridescence_ior, b.extensions.iridescence_nm, base_f0);
  return term * (1.0lf - b.extensions.iridescence) + film * b.extensions.iridescence;
}

// The dielectric's term where Fresnel's, without extensions, is `plain`, on the side from which the index is `eta`.
dvec3 extended_dielectric(Bsdf b, double cosine, double plain, double eta) {
  // Where a volume reflects all, nothing on it changes that.
  if (is_exact(b) && plain >= 1.0lf) return dvec3(1.0lf);
  double plain_f0 = b.plain.f0;
  dvec3 f0 = min(plain_f0 * b.extensions.specular_color, 1.0lf);
  dvec3 term = dvec3(0.0lf);
  if (b.plain.reflects) {
    double rise = b.plain.all_mirror ? schlick_rise(cosine) : (plain - plain_f0) / (1.0lf - plain_f0);
    term = max(b.extensions.specular * (f0 + (1.0lf - f0) * rise), 0.0lf);
  }
  if (!(b.extensions.iridescence > 0.0lf)) return term;
  // Of light from within, what goes on in the air counts: so both directions are alike.
  double in_air = cosine;
  if (is_exact(b) && eta < 1.0lf) in_air = sqrt(max(0.0lf, 1.0lf - (1.0lf - squared(cosine)) / squared(eta)));
  return with_film(b, term, in_air, b.extensions.specular * f0);
}

// Of the dielectric and the metal by their parts.
dvec3 extended_fresnel(Bsdf b, double cosine, double plain) {
  dvec3 term = (1.0lf - b.plain.metallic) * extended_dielectric(b, cosine, plain, index_behind(b));
  if (!(b.plain.metallic > 0.0lf)) return term;
  dvec3 color = b.plain.base_color;
  dvec3 metal = color + (1.0lf - color) * schlick_rise(cosine);
  if (b.extensions.iridescence > 0.0lf) metal = with_film(b, metal, cosine, color);
  return term + b.plain.metallic * metal;
}

// What the dielectric's reflection leaves to its base, in every channel.
double extended_enters(Bsdf b, double cosine) {
  return 1.0lf - largest(extended_dielectric(b, cosine, dielectric_fresnel(b.plain, cosine), index_behind(b)));
}

double mean_entering(Bsdf b) {
  if (b.extensions.iridescence > 0.0lf || !b.plain.reflects) return 1.0lf;
  double f0 = min(b.plain.f0 * largest(b.extensions.specular_color), 1.0lf);
  double reflected = 1.0lf - entering(b.plain.ior);
  return 1.0lf - b.extensions.specular * (f0 + (1.0lf - f0) * (reflected - b.plain.f0) / (1.0lf - b.plain.f0));
}

double below_coat(Bsdf b, dvec3 direction) {
  return is_within(b, direction) ? 1.0lf : coat_transmittance(b.extensions, direction);
}

double below_coat_both(Bsdf b, dvec3 to_light) {
  return min(below_coat(b, b.plain.view), below_coat(b, to_light));
}

double below_sheen_both(Bsdf b, dvec3 to_light) {
  double color = largest(b.extensions.sheen_color);
  if (!(color > 0.0lf)) return min(b.view_below_sheen, 1.0lf);
  double albedo = sheen_albedo(b.extensions.sheen, b.extensions.sheen_roughness, abs(dot(b.plain.normal, to_light)));
  return min(b.view_below_sheen, 1.0lf - color * albedo);
}

double below_both(Bsdf b, dvec3 to_light) {
  return below_coat_both(b, to_light) * below_sheen_both(b, to_light);
}

Bsdf make_extended_bsdf(MaterialPoint material, SurfacePoint surface, bool flux) {
  Bsdf b;
  b.plain = make_plain_bsdf(material, surface, flux);
  b.extended = material.extended;
  b.extensions = material.extensions;
  b.anisotropic = false;
  b.tangent = dvec3(0.0lf);
  double base = (1.0lf - material.metallic) * (1.0lf - material.transmission);
  b.diffuse = base * (1.0lf - b.extensions.diffuse_transmission);
  b.through = base * b.extensions.diffuse_transmission;
  b.view_enters = 1.0lf;
  b.view_below_sheen = 1.0lf;
  b.sheen_chance = 0.0lf;
  if (!b.extended) return b;
  if (!b.plain.scatters) return b;
  b.view_enters = extended_enters(b, b.plain.normal_view);
  // Where light goes through too, by round facets, it is reflected by those: each takes what the other leaves.
  if (b.extensions.anisotropy > 0.0lf && !b.plain.exact) {
    dvec3 direction = b.extensions.anisotropy_direction;
    dvec3 tangent = direction - dot(direction, b.plain.normal) * b.plain.normal;
    double size = length(tangent);
    b.anisotropic = size > 0.0lf;
    if (b.anisotropic) b.tangent = tangent / size;
  }
  double color = largest(b.extensions.sheen_color);
  if (!(color > 0.0lf)) return b;
  double sheen = color * sheen_albedo(b.extensions.sheen, b.extensions.sheen_roughness, b.plain.normal_view);
  b.view_below_sheen = 1.0lf - sheen;
  double under = b.diffuse * b.view_enters * largest(material.base_color) * (1.0lf - sheen);
  b.sheen_chance = max(sheen, kMinWeight) / (max(sheen, kMinWeight) + under);
  return b;
}

bool extended_present(Bsdf b, uint lobe) {
  if (!b.plain.scatters) return false;
  if (lobe == kDiffuse) {
    return b.sheen_chance > 0.0lf || (b.diffuse * largest(b.plain.base_color) > 0.0lf && b.view_enters > 0.0lf);
  }
  if (lobe == kReflection) {
    bool of_dielectric = b.extensions.specular > 0.0lf || (is_exact(b) && is_within(b, b.plain.view));
    return b.plain.metallic > 0.0lf || b.extensions.iridescence > 0.0lf || (b.plain.reflects && of_dielectric);
  }
  if (lobe == kTransmission) return plain_present(b.plain, kTransmission);
  if (lobe == kCoat) {
    bool has_coat = b.extensions.clearcoat > 0.0lf && !is_within(b, b.plain.view);
    return has_coat && plain_present(coat_bsdf(b), kReflection);
  }
  return b.through * largest(b.extensions.diffuse_transmission_color) > 0.0lf;
}

bool extended_is_delta(Bsdf b, uint lobe) {
  if (lobe == kReflection) return !b.anisotropic && b.plain.roughness < kDeltaRoughness;
  if (lobe == kTransmission) return plain_is_delta(b.plain, kTransmission);
  return lobe == kCoat && b.extensions.clearcoat_roughness < kDeltaRoughness;
}

double extended_diffuse_pdf(Bsdf b, dvec3 to_light) {
  if (!same_side(b.plain, to_light)) return 0.0lf;
  double cosine = dot(b.plain.normal, to_light);
  return b.sheen_chance * 0.5lf * kInversePi + (1.0lf - b.sheen_chance) * cosine * kInversePi;
}

dvec3 extended_diffuse(Bsdf b, dvec3 to_light) {
  if (!b.plain.scatters || !same_side(b.plain, to_light)) return dvec3(0.0lf);
  dvec3 result = dvec3(0.0lf);
  double cosine = dot(b.plain.normal, to_light);
  if (b.diffuse > 0.0lf) {
    bool exact = is_exact(b);
    double enters = extended_enters(b, exact ? cosine : 0.5lf * length(b.plain.view + to_light));
    if (exact) enters = b.view_enters * enters / mean_entering(b);
    result = (b.diffuse * kInversePi * enters * below_sheen_both(b, to_light)) * b.plain.base_color;
  }
  if (b.sheen_chance > 0.0lf) {
    dvec3 between = normalize(b.plain.view + to_light);
    Sheen sheen = make_sheen(b.extensions.sheen_roughness, b.plain.normal_view);
    result += sheen_value(sheen, min(cosine, 1.0lf), dot(b.plain.normal, between)) * b.extensions.sheen_color;
  }
  return below_coat_both(b, to_light) * result;
}

// f of the reflection and its density, where it is present.
dvec3 extended_reflection(Bsdf b, dvec3 to_light, out double pdf) {
  pdf = 0.0lf;
  if (!b.plain.scatters || extended_is_delta(b, kReflection) || !same_side(b.plain, to_light)) return dvec3(0.0lf);
  double facets;
  if (b.anisotropic) {
    facets = anisotropic_value(anisotropic_facets(b), to_light, pdf);
  } else {
    facets = plain_lobe(white_facets(b), kReflection, to_light, pdf).g;
  }
  if (!(facets > 0.0lf)) return dvec3(0.0lf);
  double cosine = 0.5lf * length(b.plain.view + to_light);
  return (facets * below_both(b, to_light)) * extended_fresnel(b, cosine, dielectric_fresnel(b.plain, cosine));
}

// What the extensions leave of light that a plain surface lets through to there.
double transmission_scale(Bsdf b, dvec3 to_light) {
  double cosine = b.plain.normal_view;
  double eta = index_behind(b);
  if (!plain_is_delta(b.plain, kTransmission)) {
    // As the facets of a plain one.
    dvec3 between = b.plain.view + eta * to_light;
    if (!b.plain.solid || eta == 1.0lf) {
      between = b.plain.view + to_light - 2.0lf * dot(b.plain.normal, to_light) * b.plain.normal;
    }
    double size = length(between);
    if (size > 0.0lf) cosine = abs(dot(b.plain.view, between)) / size;
  }
  double plain = dielectric_fresnel(b.plain, cosine);
  double kept = plain < 1.0lf ? (1.0lf - largest(extended_dielectric(b, cosine, plain, eta))) / (1.0lf - plain) : 1.0lf;
  return kept * below_both(b, to_light);
}

dvec3 extended_through(Bsdf b, dvec3 to_light) {
  if (!b.plain.scatters || !other_side(b.plain, to_light)) return dvec3(0.0lf);
  double cosine = -dot(b.plain.normal, to_light);
  double eta = index_behind(b);
  double plain = dielectric_fresnel(b.plain, cosine);
  // Of a surface that light also goes through undiffused, Fresnel's equations count on the side of each direction.
  if (is_exact(b) && b.plain.solid) {
    eta = 1.0lf / eta;
    plain = fresnel_exact(min(cosine, 1.0lf), eta);
  }
  double enters = min(b.view_enters, 1.0lf - largest(extended_dielectric(b, cosine, plain, eta)));
  return (b.through * kInversePi * enters * below_both(b, to_light)) * b.extensions.diffuse_transmission_color;
}

// f of one lobe and its density.
dvec3 extended_lobe(Bsdf b, uint lobe, dvec3 to_light, out double pdf) {
  pdf = 0.0lf;
  dvec3 value = dvec3(0.0lf);
  bool is_present = extended_present(b, lobe);
  if (lobe == kDiffuse) {
    value = extended_diffuse(b, to_light);
    pdf = extended_diffuse_pdf(b, to_light);
  } else if (lobe == kReflection) {
    value = extended_reflection(b, to_light, pdf);
  } else if (lobe == kTransmission) {
    value = scatter_through(b.plain, to_light, pdf);
    if (value != dvec3(0.0lf)) value *= transmission_scale(b, to_light);
  } else if (lobe == kCoat) {
    if (is_present && same_side(b.plain, to_light)) {
      double quotient = max(0.0lf, dot(b.extensions.clearcoat_normal, to_light)) / dot(b.plain.normal, to_light);
      value = (b.extensions.clearcoat * quotient) * plain_lobe(coat_bsdf(b), kReflection, to_light, pdf);
    }
  } else {
    value = extended_through(b, to_light);
    if (other_side(b.plain, to_light)) pdf = -dot(b.plain.normal, to_light) * kInversePi;
  }
  if (!is_present) pdf = 0.0lf;
  return value;
}

bool extended_sample_diffuse(Bsdf b, dvec2 u, out BsdfSample s) {
  s = BsdfSample(dvec3(0.0lf), dvec3(0.0lf), 0.0lf);
  if (u.x < b.sheen_chance) {
    double z = u.x / b.sheen_chance;
    dvec2 across = sqrt(max(0.0lf, 1.0lf - z * z)) * on_circle(u.y);
    s.direction = normalize(basis_about(b.plain.normal) * dvec3(across, z));
  } else {
    s.direction = cosine_lobe(b.plain.normal, dvec2((u.x - b.sheen_chance) / (1.0lf - b.sheen_chance), u.y));
  }
  s.pdf = extended_diffuse_pdf(b, s.direction);
  if (!(s.pdf > 0.0lf)) return false;
  s.weight = (dot(b.plain.normal, s.direction) / s.pdf) * extended_diffuse(b, s.direction);
  return true;
}

bool extended_sample_reflection(Bsdf b, dvec2 u, out BsdfSample s) {
  s = BsdfSample(dvec3(0.0lf), dvec3(0.0lf), 0.0lf);
  double facet_weight = 1.0lf;
  double cosine = b.plain.normal_view;
  if (b.anisotropic) {
    AnisotropicFacets facets = anisotropic_facets(b);
    if (!anisotropic_sample(facets, u, s.direction) || !same_side(b.plain, s.direction)) return false;
    double value = anisotropic_value(facets, s.direction, s.pdf);
    if (!(s.pdf > 0.0lf) || isinf(s.pdf)) return false;
    facet_weight = value > 0.0lf ? dot(b.plain.normal, s.direction) / s.pdf * value : 0.0lf;
  } else {
    if (!plain_sample(white_facets(b), kReflection, u, s)) return false;
    facet_weight = s.weight.g;
  }
  if (!extended_is_delta(b, kReflection)) cosine = 0.5lf * length(b.plain.view + s.direction);
  dvec3 fresnel = extended_fresnel(b, cosine, dielectric_fresnel(b.plain, cosine));
  s.weight = (facet_weight * below_both(b, s.direction)) * fresnel;
  return true;
}

bool extended_sample(Bsdf b, uint lobe, dvec2 u, out BsdfSample s) {
  s = BsdfSample(dvec3(0.0lf), dvec3(0.0lf), 0.0lf);
  if (!extended_present(b, lobe)) return false;
  if (lobe == kDiffuse) return extended_sample_diffuse(b, u, s);
  if (lobe == kReflection) return extended_sample_reflection(b, u, s);
  if (lobe == kTransmission) {
    if (!plain_sample(b.plain, kTransmission, u, s)) return false;
    s.weight *= transmission_scale(b, s.direction);
    return true;
  }
  if (lobe == kCoat) {
    if (!plain_sample(coat_bsdf(b), kReflection, u, s)) return false;
    s.weight *= b.extensions.clearcoat;
    return extended_is_delta(b, kCoat) || same_side(b.plain, s.direction);
  }
  s.direction = cosine_lobe(-b.plain.normal, u);
  if (!other_side(b.plain, s.direction)) return false;
  s.pdf = -dot(b.plain.normal, s.direction) * kInversePi;
  s.weight = kPi * extended_through(b, s.direction);
  return true;
}

// Of the only direction of a lobe that has one.
dvec3 extended_single_weight(Bsdf b, uint lobe) {
  PlainBsdf from = b.plain;
  if (lobe == kReflection) from = white_facets(b);
  if (lobe == kCoat) from = coat_bsdf(b);
  BsdfSample only;
  if (!sample_single(from, lobe == kTransmission ? kTransmission : kReflection, only)) return dvec3(0.0lf);
  if (lobe == kCoat) return b.extensions.clearcoat * only.weight;
  if (lobe == kTransmission) return transmission_scale(b, only.direction) * only.weight;
  double cosine = b.plain.normal_view;
  dvec3 fresnel = extended_fresnel(b, cosine, dielectric_fresnel(b.plain, cosine));
  return (only.weight.g * below_both(b, only.direction)) * fresnel;
}

dvec3 extended_weight(Bsdf b, uint lobe) {
  if (!extended_present(b, lobe)) return dvec3(0.0lf);
  if (extended_is_delta(b, lobe)) return extended_single_weight(b, lobe);
  double under_coat = below_coat(b, b.plain.view);
  double under = under_coat * b.view_below_sheen;
  double straight = dielectric_fresnel(b.plain, b.plain.normal_view);
  if (lobe == kDiffuse) {
    double sheen = 0.0lf;
    if (b.sheen_chance > 0.0lf) {
      sheen = max(sheen_albedo(b.extensions.sheen, b.extensions.sheen_roughness, b.plain.normal_view), kMinWeight);
    }
    double enters = is_exact(b) ? b.view_enters / mean_entering(b) : max(extended_enters(b, 1.0lf), kMinWeight);
    return (under_coat * sheen) * b.extensions.sheen_color + (under * b.diffuse * enters) * b.plain.base_color;
  }
  if (lobe == kReflection) {
    double dielectric = is_exact(b) ? facet_fraction(b.plain, kReflection) : straight;
    return max(under * extended_fresnel(b, b.plain.normal_view, dielectric), kMinWeight);
  }
  if (lobe == kTransmission) {
    double kept = straight < 1.0lf ? b.view_enters / (1.0lf - straight) : 1.0lf;
    return max(under * kept, kMinWeight) * plain_weight(b.plain, kTransmission);
  }
  if (lobe == kCoat) return b.extensions.clearcoat * plain_weight(coat_bsdf(b), kReflection);
  return (under * b.through * max(b.view_enters, kMinWeight)) * b.extensions.diffuse_transmission_color;
}
