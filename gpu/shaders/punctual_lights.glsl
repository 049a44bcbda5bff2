// Lights of KHR_lights_punctual, spheres, discs in the sky and the headlight: rt/lights/punctual_light.h.
// Needs reals.glsl, sampling.glsl and view.glsl.

const uint kPointLight = 0u;
const uint kDirectionalLight = 1u;
const uint kSpotLight = 2u;
const uint kHeadlight = 3u;

struct PunctualLight {
  dvec3 position;
  double range;   // metres; 0: unbounded
  double radius;  // metres
  vec3 direction;
  vec3 intensity;
  float inner_cone_radians;
  float outer_cone_radians;
  float angular_radius_radians;
  uint type;
};
layout(buffer_reference, scalar) readonly buffer PunctualLights {
  PunctualLight lights[];
};

// As in rt/lights/punctual_light.h.
struct LightSample {
  dvec3 to_light;   // unit length
  double distance;  // metres, infinite for directional lights and the environment
  dvec3 goal;       // the light's place, world; meaningful at finite distance
  double offset;    // metres before the goal in which its own surface may be met
  dvec3 weight;     // radiance / pdf, over the probability it was chosen with
  double pdf;       // per solid angle, choice included; 0 for lights rays cannot meet
  bool casts_shadows;
};

LightSample no_light() {
  return LightSample(dvec3(0.0lf), 0.0lf, dvec3(0.0lf), 0.0lf, dvec3(0.0lf), 0.0lf, true);
}

const dvec3 kHeadlightLift = dvec3(0.25lf, 0.4lf, 0.1lf);

// The spot's ramp over the cosine off its axis: zero at `foot`, and one where it would be `width` higher.
struct SpotRamp {
  double foot;
  double width;
};

SpotRamp ramp_of(PunctualLight light) {
  double foot = cosine_of(double(light.outer_cone_radians));
  return SpotRamp(foot, max(0.001lf, cosine_of(double(light.inner_cone_radians)) - foot));
}

double ramp_value(SpotRamp ramp, double cosine) {
  return squared(clamp((cosine - ramp.foot) / ramp.width, 0.0lf, 1.0lf));
}

// Where the ramp ends; a narrow spot's never reaches one.
double ramp_top(SpotRamp ramp) {
  return min(1.0lf, ramp.foot + ramp.width);
}

double ramp_slope_integral(SpotRamp ramp) {
  double rise = ramp_top(ramp) - ramp.foot;
  return rise * rise * rise / (3.0lf * ramp.width * ramp.width);
}

// Over all cosines; times 2 pi: over all directions.
double ramp_integral(SpotRamp ramp) {
  return 1.0lf - ramp_top(ramp) + ramp_slope_integral(ramp);
}

// A cosine with the density value / integral; 1 for u = 0.
double sample_ramp(SpotRamp ramp, double u) {
  double from_top = u * ramp_integral(ramp);
  double level = 1.0lf - ramp_top(ramp);
  if (from_top < level) return 1.0lf - from_top;
  double rest = max(0.0lf, 1.0lf - (from_top - level) / ramp_slope_integral(ramp));
  return ramp.foot + (ramp_top(ramp) - ramp.foot) * cube_root_of(rest);
}

// 1 - cos of half the angle a directional light is seen under.
double opening_of(PunctualLight light) {
  return 2.0lf * squared(sine_of(0.5lf * clamp(double(light.angular_radius_radians), 0.0lf, 0.5lf * kPi)));
}

// Whether every sample of it is the same.
bool is_fixed(PunctualLight light) {
  if (light.type == kHeadlight) return true;
  if (light.type == kDirectionalLight) return !(light.angular_radius_radians > 0.0);
  return !(light.radius > 0.0lf);
}

// Of a directional light: on a plane that always faces the sampled direction.
dvec3 facing_irradiance(PunctualLight light) {
  return dvec3(light.intensity) * (2.0lf / (2.0lf - opening_of(light)));
}

LightSample sample_directional(PunctualLight light, dvec2 u) {
  LightSample made = no_light();
  made.to_light = -normalize(dvec3(light.direction));
  if (!is_fixed(light)) made.to_light = in_cone(made.to_light, opening_of(light), u);
  made.distance = kInfinity;
  made.weight = facing_irradiance(light);
  return made;
}

LightSample sample_headlight(PunctualLight light, dvec3 position, View view) {
  LightSample made = no_light();
  made.casts_shadows = false;
  if (view.orthographic != 0u) {
    made.to_light = normalize(view.back + kHeadlightLift);
    made.distance = kInfinity;
    made.weight = dvec3(light.intensity);
    return made;
  }
  dvec3 to_eye = view.eye - position;
  made.distance = length(to_eye);
  made.goal = view.eye;
  if (!(made.distance > 0.0lf) || !is_finite(made.distance)) return made;
  made.to_light = normalize(to_eye / made.distance + kHeadlightLift);
  made.weight = dvec3(light.intensity);
  return made;
}

double range_window(double distance_m, double range) {
  if (range <= 0.0lf) return 1.0lf;
  double ratio = distance_m / range;
  return clamp(1.0lf - ratio * ratio * ratio * ratio, 0.0lf, 1.0lf);
}

LightSample sample_punctual(PunctualLight light, dvec3 position, View view, dvec2 u) {
  if (light.type == kDirectionalLight) return sample_directional(light, u);
  if (light.type == kHeadlight) return sample_headlight(light, position, view);
  LightSample made = no_light();
  dvec3 to_center = light.position - position;
  double distance_m = length(to_center);
  made.distance = distance_m;
  made.goal = light.position;
  if (!(distance_m > light.radius) || !is_finite(distance_m)) return made;
  made.to_light = to_center / distance_m;
  double cosine = 1.0lf;  // of half the angle the sphere is seen under
  if (light.radius > 0.0lf) {
    double sine = light.radius / distance_m;
    cosine = sqrt((distance_m - light.radius) / distance_m * (1.0lf + sine));
    double opening = sine * sine / (1.0lf + cosine);
    double below = opening * u.x;
    made.to_light = in_cone(made.to_light, opening, u);
    // Half the chord inside the sphere: (r sin)^2 of the angle at the place, from r^2 without cancelling much.
    double off_axis = distance_m * sqrt(below * (2.0lf - below));
    double half_chord = sqrt(max(0.0lf, (light.radius - off_axis) * (light.radius + off_axis)));
    made.distance = max(0.0lf, distance_m * (1.0lf - below) - half_chord);
    made.goal = position + made.distance * made.to_light;
  }
  // Radiance, I / (pi r^2), times the solid angle of the cone, 2 pi sin^2 / (1 + cos): the radius cancels.
  double strength = range_window(distance_m, light.range) * 2.0lf / (distance_m * distance_m * (1.0lf + cosine));
  if (light.type == kSpotLight) {
    strength *= ramp_value(ramp_of(light), -dot(dvec3(light.direction), made.to_light));
  }
  if (is_finite(strength)) made.weight = dvec3(light.intensity) * strength;
  return made;
}
