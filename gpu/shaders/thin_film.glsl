// What a film on a base reflects: rt/materials/thin_film.h.
// Needs reals.glsl, materials.glsl and microfacets.glsl.

double film_gaussian(double phase, double value, double position, double variance, double by) {
  return value * sqrt(2.0lf * kPi * variance) * cosine_of(position * phase + by) * exponential_of(-variance * squared(phase));
}

// The eye's response to a spectrum cos(2 pi path / wavelength + shift), in linear sRGB.
dvec3 film_sensitivity(double path_nm, dvec3 shift) {
  double phase = 2.0lf * kPi * path_nm * 1e-9lf;
  dvec3 xyz = dvec3(film_gaussian(phase, 5.4856e-13lf, 1.6810e+06lf, 4.3278e+09lf, shift.x) +
                        film_gaussian(phase, 9.7470e-14lf, 2.2399e+06lf, 4.5282e+09lf, shift.x),
                    film_gaussian(phase, 4.4201e-13lf, 1.7953e+06lf, 9.3046e+09lf, shift.y),
                    film_gaussian(phase, 5.2481e-13lf, 2.2084e+06lf, 6.6121e+09lf, shift.z));
  xyz /= 1.0685e-7lf;
  const dmat3 kToRec709 = dmat3(3.2404542lf, -0.9692660lf, 0.0556434lf, -1.5371385lf, 1.8760108lf, -0.2040259lf,
                                -0.4985314lf, 0.0415560lf, 1.0572252lf);
  return kToRec709 * xyz;
}

// The light comes in air, `cosine` off the normal, onto a film of index `ior` that is `nm` thick, on a base that alone reflects
// `base_f0` looked at straight.
dvec3 thin_film_fresnel(double cosine, double ior, double nm, dvec3 base_f0) {
  // Towards no film at all its index becomes that of the air.
  const double kThinnest = 0.03lf;
  double grown = clamp(nm / kThinnest, 0.0lf, 1.0lf);
  double film = 1.0lf + (ior - 1.0lf) * grown * grown * (3.0lf - 2.0lf * grown);
  double sine2 = (1.0lf - squared(min(cosine, 1.0lf))) / squared(film);
  if (!(sine2 <= 1.0lf)) return dvec3(1.0lf);
  double inside = sqrt(1.0lf - sine2);

  double first = fresnel_exact(clamp(cosine, 0.0lf, 1.0lf), film);
  double through = 1.0lf - first;
  double half_turn = film < 1.0lf ? 0.0lf : kPi;
  dvec3 second;
  dvec3 shift;
  for (int c = 0; c < 3; ++c) {
    double root = sqrt(clamp(base_f0[c], 0.0lf, 0.9999lf));
    double base = (1.0lf + root) / (1.0lf - root);
    double f0 = squared((base - film) / (base + film));
    second[c] = f0 + (1.0lf - f0) * schlick_rise(inside);
    shift[c] = half_turn + (base < film ? kPi : 0.0lf);
  }
  dvec3 both = min(first * second, 0.9999lf);
  dvec3 returned = squared(through) * second / (1.0lf - both);
  dvec3 result = first + returned;
  dvec3 order = returned - through;
  double path = 2.0lf * film * nm * inside;
  for (int m = 1; m <= 2; ++m) {
    order *= sqrt(both);
    result += order * (2.0lf * film_sensitivity(double(m) * path, double(m) * shift));
  }
  return clamp(result, 0.0lf, 1.0lf);
}
