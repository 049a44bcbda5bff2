// Functions of real numbers that shaders have in single precision only, to some units in the last place of double.

const double kPi = 3.14159265358979323846lf;
const double kInfinity = 1.0lf / 0.0lf;

double squared(double x) {
  return x * x;
}

double largest(dvec3 v) {
  return max(max(v.x, v.y), v.z);
}

bool is_negative(double x) {  // -0 too
  return (unpackDouble2x32(x).y >> 31) != 0u;
}

bool is_finite(double x) {
  return !isnan(x) && !isinf(x);
}

// 2^k of a normal number.
double power_of_two(int k) {
  return packDouble2x32(uvec2(0u, uint(k + 1023) << 20));
}

// What is left of an angle over the nearest multiple of a right one, by Cody and Waite's two steps; `quarter`: that multiple.
double within_quarter(double angle, out int quarter) {
  double nearest = floor(angle * 0.63661977236758134308lf + 0.5lf);
  quarter = int(nearest) & 3;
  return (angle - nearest * 1.57079632673412561417lf) - nearest * 6.07710050650619224932e-11lf;
}

double sine_near(double r) {
  double x = r * r;
  return r + r * x * (-1.0lf / 6.0lf + x * (1.0lf / 120.0lf + x * (-1.0lf / 5040.0lf + x * (1.0lf / 362880.0lf +
         x * (-1.0lf / 39916800.0lf + x * (1.0lf / 6227020800.0lf + x * (-1.0lf / 1307674368000.0lf +
         x * (1.0lf / 355687428096000.0lf))))))));
}

double cosine_near(double r) {
  double x = r * r;
  return 1.0lf + x * (-0.5lf + x * (1.0lf / 24.0lf + x * (-1.0lf / 720.0lf + x * (1.0lf / 40320.0lf +
         x * (-1.0lf / 3628800.0lf + x * (1.0lf / 479001600.0lf + x * (-1.0lf / 87178291200.0lf +
         x * (1.0lf / 20922789888000.0lf))))))));
}

// Cosine and sine.
dvec2 circle_at(double angle) {
  int quarter;
  double r = within_quarter(angle, quarter);
  dvec2 at = dvec2(cosine_near(r), sine_near(r));
  if ((quarter & 1) != 0) at = dvec2(-at.y, at.x);
  return (quarter & 2) != 0 ? -at : at;
}

double sine_of(double angle) {
  return circle_at(angle).y;
}

double cosine_of(double angle) {
  return circle_at(angle).x;
}

// Of t in [0, 1]: from the nearest of five angles on, by its series.
double arc_tangent_within(double t) {
  double base = 0.0lf;
  double from = 0.0lf;
  if (t > 0.82067879082866033097lf) {
    base = 0.78539816339744830962lf;
    from = 1.0lf;
  } else if (t > 0.53451113595079166839lf) {
    base = 0.58904862254808623221lf;
    from = 0.66817863791929891999lf;
  } else if (t > 0.30334668360734239168lf) {
    base = 0.39269908169872415481lf;
    from = 0.41421356237309504880lf;
  } else if (t > 0.09849140335716425316lf) {
    base = 0.19634954084936207740lf;
    from = 0.19891236737965800691lf;
  }
  double d = (t - from) / (1.0lf + t * from);
  double x = d * d;
  return base + (d + d * x * (-1.0lf / 3.0lf + x * (0.2lf + x * (-1.0lf / 7.0lf + x * (1.0lf / 9.0lf +
         x * (-1.0lf / 11.0lf + x * (1.0lf / 13.0lf + x * (-1.0lf / 15.0lf))))))));
}

double arc_tangent_of(double y, double x) {
  double ay = abs(y);
  double ax = abs(x);
  double more = max(ax, ay);
  double angle = more > 0.0lf ? arc_tangent_within(min(ax, ay) / more) : 0.0lf;
  if (ay > ax) angle = 0.5lf * kPi - angle;
  if (is_negative(x)) angle = kPi - angle;
  return is_negative(y) ? -angle : angle;
}

double exponential_of(double x) {
  if (x > 709.0lf) return kInfinity;
  if (!(x > -740.0lf)) return isnan(x) ? x : 0.0lf;
  double k = floor(x * 1.44269504088896340736lf + 0.5lf);
  double r = (x - k * 6.93147180369123816490e-01lf) - k * 1.90821492927058770002e-10lf;
  double sum = 1.0lf + r * (1.0lf + r * (0.5lf + r * (1.0lf / 6.0lf + r * (1.0lf / 24.0lf + r * (1.0lf / 120.0lf +
               r * (1.0lf / 720.0lf + r * (1.0lf / 5040.0lf + r * (1.0lf / 40320.0lf + r * (1.0lf / 362880.0lf +
               r * (1.0lf / 3628800.0lf + r * (1.0lf / 39916800.0lf + r * (1.0lf / 479001600.0lf +
               r * (1.0lf / 6227020800.0lf)))))))))))));
  int half_k = int(k) / 2;
  return sum * power_of_two(half_k) * power_of_two(int(k) - half_k);
}

// Of x > 0; else -infinity.
double logarithm_of(double x) {
  if (!(x > 0.0lf)) return -kInfinity;
  double exponent = 0.0lf;
  if (x < 1e-300lf) {
    x *= 18014398509481984.0lf;
    exponent = -54.0lf;
  }
  uvec2 bits = unpackDouble2x32(x);
  exponent += double(int(bits.y >> 20) - 1023);
  double m = packDouble2x32(uvec2(bits.x, (bits.y & 0xFFFFFu) | 0x3FF00000u));
  if (m > 1.41421356237309504880lf) {
    m *= 0.5lf;
    exponent += 1.0lf;
  }
  double s = (m - 1.0lf) / (m + 1.0lf);
  double y = s * s;
  double sum = s + s * y * (1.0lf / 3.0lf + y * (0.2lf + y * (1.0lf / 7.0lf + y * (1.0lf / 9.0lf + y * (1.0lf / 11.0lf +
               y * (1.0lf / 13.0lf + y * (1.0lf / 15.0lf + y * (1.0lf / 17.0lf + y * (1.0lf / 19.0lf +
               y * (1.0lf / 21.0lf))))))))));
  return exponent * 1.90821492927058770002e-10lf + 2.0lf * sum + exponent * 6.93147180369123816490e-01lf;
}

// x^y for x >= 0.
double power_of(double x, double y) {
  if (!(x > 0.0lf)) return y > 0.0lf ? 0.0lf : 1.0lf;
  return exponential_of(y * logarithm_of(x));
}

double cube_root_of(double x) {
  double a = abs(x);
  if (!(a > 0.0lf)) return x;
  double root = exponential_of(logarithm_of(a) / 3.0lf);
  root -= (root - a / (root * root)) / 3.0lf;
  return x < 0.0lf ? -root : root;
}
