// White sheen looked at from one side: rt/materials/sheen.h.
// Needs reals.glsl and materials.glsl.

const uint kSheenSteps = 32u;

struct Sheen {
  double inverse_alpha;
  double a;
  double b;
  double c;
  double d;
  double e;
  double normal_view;
  double lambda_view;
};

double sheen_fit(Sheen sheen, double cosine) {
  return sheen.a / (1.0lf + sheen.b * power_of(cosine, sheen.c)) + sheen.d * cosine + sheen.e;
}

double sheen_lambda(Sheen sheen, double cosine) {
  if (cosine < 0.5lf) return exponential_of(sheen_fit(sheen, cosine));
  return exponential_of(2.0lf * sheen_fit(sheen, 0.5lf) - sheen_fit(sheen, 1.0lf - min(cosine, 1.0lf)));
}

Sheen make_sheen(double roughness, double normal_view) {
  const double kMinSheenAlpha = 5e-3lf;
  double alpha = max(squared(roughness), kMinSheenAlpha);
  double even = squared(1.0lf - alpha);
  Sheen sheen;
  sheen.inverse_alpha = 1.0lf / alpha;
  sheen.a = 21.5473lf + (25.3245lf - 21.5473lf) * even;
  sheen.b = 3.82987lf + (3.32435lf - 3.82987lf) * even;
  sheen.c = 0.19823lf + (0.16801lf - 0.19823lf) * even;
  sheen.d = -1.97760lf + (-1.27393lf - -1.97760lf) * even;
  sheen.e = -4.32054lf + (-4.85967lf - -4.32054lf) * even;
  sheen.normal_view = normal_view;
  sheen.lambda_view = sheen_lambda(sheen, normal_view);
  return sheen;
}

// f, 1/sr, by the cosines of the light and the half vector.
double sheen_value(Sheen sheen, double normal_light, double normal_half) {
  double sine2 = max(0.0lf, 1.0lf - squared(normal_half));
  double distribution = (2.0lf + sheen.inverse_alpha) * power_of(sine2, 0.5lf * sheen.inverse_alpha) / (2.0lf * kPi);
  double lambdas = 1.0lf + sheen.lambda_view + sheen_lambda(sheen, normal_light);
  return distribution / (lambdas * 4.0lf * sheen.normal_view * normal_light);
}

// The part of a furnace's light that white sheen reflects.
double sheen_albedo(SheenAlbedos table, double roughness, double normal_view) {
  double y = clamp(sqrt(max(roughness, 0.0lf)), 0.0lf, 1.0lf) * double(kSheenSteps - 1u);
  double x = clamp(sqrt(max(normal_view, 0.0lf)), 0.0lf, 1.0lf) * double(kSheenSteps - 1u);
  uint row = min(uint(y), kSheenSteps - 2u);
  uint column = min(uint(x), kSheenSteps - 2u);
  double fy = y - double(row);
  double fx = x - double(column);
  uint at = row * kSheenSteps + column;
  double upper = table.albedo[at] * (1.0lf - fx) + table.albedo[at + 1u] * fx;
  double lower = table.albedo[at + kSheenSteps] * (1.0lf - fx) + table.albedo[at + kSheenSteps + 1u] * fx;
  return clamp(upper * (1.0lf - fy) + lower * fy, 0.0lf, 1.0lf);
}
