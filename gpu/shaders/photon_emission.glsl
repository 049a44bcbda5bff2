// Photons that lights send out: LightSampler::emit() of rt/lights/light_sampler.h, but for coated triangles.
// Needs scene.glsl, lights.glsl and media.glsl, and what they need.

// As in rt/lights/punctual_light.h.
struct PhotonStart {
  dvec3 origin;     // world
  dvec3 direction;  // unit length
  dvec3 flux;       // of one photon of one: divide by how many are sent
  double offset;    // metres to leave the emitting surface by
  dvec3 center;     // of a light with a range, world
  double range;     // metres from there at which its light ends; 0: nowhere
  Media media;      // what it starts in
  uint surface;     // that emits it; kNoSurface: none
  bool endless;     // it comes from without the scene: any origin before that would do
};

PhotonStart no_photon() {
  Media nothing = Media(dvec3(0.0lf), dvec3(0.0lf));
  return PhotonStart(dvec3(0.0lf), dvec3(0.0lf), dvec3(0.0lf), 0.0lf, dvec3(0.0lf), 0.0lf, nothing, kNoSurface, false);
}

// Watts.
dvec3 power_of(Lights lights, PunctualLight light) {
  dvec3 intensity = dvec3(light.intensity);
  if (light.type == kPointLight) return 4.0lf * kPi * intensity;
  if (light.type == kSpotLight) return 2.0lf * kPi * ramp_integral(ramp_of(light)) * intensity;
  if (light.type == kDirectionalLight) return kPi * lights.lit_radius * lights.lit_radius * facing_irradiance(light);
  return dvec3(0.0lf);
}

// A photon that crosses the sphere about the scene along `direction`.
PhotonStart emit_from_outside(Lights lights, dvec3 direction, dvec3 flux, dvec2 u_place) {
  PhotonStart start = no_photon();
  dvec2 across = lights.lit_radius * in_disc(u_place);
  start.origin = lights.lit_center + basis_about(direction) * dvec3(across, -lights.lit_radius);
  start.direction = direction;
  start.flux = flux;
  start.endless = true;
  return start;
}

PhotonStart emit_punctual(Lights lights, PunctualLight light, dvec2 u_place, dvec2 u_direction) {
  dvec3 flux = power_of(lights, light);
  if (light.type == kDirectionalLight) {
    return emit_from_outside(lights, -sample_directional(light, u_direction).to_light, flux, u_place);
  }
  PhotonStart start = no_photon();
  start.origin = light.position;
  start.center = light.position;
  start.range = light.range;
  start.flux = flux;
  if (light.type == kSpotLight) {
    double opening = 1.0lf - sample_ramp(ramp_of(light), u_direction.x);
    start.direction = in_cone(normalize(dvec3(light.direction)), opening, dvec2(1.0lf, u_direction.y));
  } else {
    start.direction = on_sphere(u_direction);
  }
  if (light.radius > 0.0lf) {
    // A sphere of uniform radiance looks like a uniform disc from everywhere: its photons leave the side they go to.
    dvec3 on_front = dvec3(in_disc(u_place), sqrt(max(0.0lf, 1.0lf - u_place.x)));
    start.origin += light.radius * (basis_about(start.direction) * on_front);
  }
  return start;
}

// Of two sides, from the front for `u_side` below a half.
PhotonStart emit_triangle(Materials materials, TriangleLight triangle, double u_side, dvec2 u_place, dvec2 u_direction) {
  PhotonStart start = no_photon();
  dvec2 at = uniform_in_triangle(u_place);
  start.origin = triangle.v0 + at.x * triangle.e1 + at.y * triangle.e2;
  bool is_front = triangle.two_sided == 0u || u_side < 0.5lf;
  start.direction = cosine_lobe(is_front ? triangle.normal : -triangle.normal, u_direction);
  start.flux = sides_of(triangle) * kPi * triangle.area * triangle_radiance(materials, triangle, at);
  start.surface = triangle.surface;
  start.offset = triangle.offset;
  return start;
}

// Lights are chosen by their power; the mean flux of all photons is what they send out. False where nothing gives light.
bool emit_photon(Lights lights, double choice, dvec2 u_place, dvec2 u_direction, out PhotonStart start) {
  start = no_photon();
  uint count = lights.power_sums_count;
  if (count == 0u || !(lights.power_sums.sums[count - 1u] > 0.0lf)) return false;
  Sums sums = lights.power_sums;
  DiscreteSample picked = sample_discrete(sums, 0u, count, choice);
  if (picked.index < lights.punctual_count) {
    start = emit_punctual(lights, lights.punctual.lights[picked.index], u_place, u_direction);
  } else if (picked.index < environment_number(lights)) {
    Materials materials = lights.materials;
    TriangleLight triangle = lights.triangles.lights[picked.index - lights.punctual_count];
    start = emit_triangle(materials, triangle, picked.rest, u_place, u_direction);
  } else {
    Environment map = lights.environment.environment;
    dvec3 from;
    if (!sample_environment(map, dvec3(0.0lf), 0.0lf, u_direction, from)) return false;
    DirectionalRadiance seen = evaluate_environment(map, from, dvec3(0.0lf));
    double disc = kPi * lights.lit_radius * lights.lit_radius;
    dvec3 flux = seen.pdf > 0.0lf ? seen.radiance * (disc / seen.pdf) : dvec3(0.0lf);
    start = emit_from_outside(lights, -from, flux, u_place);
  }
  start.flux /= picked.probability;
  if (lights.has_media != 0u && picked.index < environment_number(lights)) {
    start.media.here = lights.media.absorption[2u * picked.index];
    start.media.around = lights.media.absorption[2u * picked.index + 1u];
  }
  return true;
}
