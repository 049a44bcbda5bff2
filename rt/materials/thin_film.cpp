#include "rt/materials/thin_film.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/exponential.hpp>
#include <glm/mat3x3.hpp>
#include <numbers>

#include "rt/materials/microfacets.h"

namespace hpr {
namespace {

double schlick(double f0, double cosine) {
  const double m = 1.0 - std::clamp(cosine, 0.0, 1.0);
  return f0 + (1.0 - f0) * (squared(squared(m)) * m);
}

double f0_between(double a, double b) {
  return squared((a - b) / (a + b));
}

double index_of(double f0) {
  const double root = std::sqrt(std::clamp(f0, 0.0, 0.9999));
  return (1.0 + root) / (1.0 - root);
}

/// The eye's response to a spectrum cos(2 pi path / wavelength + shift), in the Fourier domain and linear sRGB:
/// Gaussians fitted to the CIE 1931 functions, of all light 1 (Belcour and Barla 2017, their code for section 4).
glm::dvec3 sensitivity(double path_nm, const glm::dvec3& shift) {
  const double phase = 2.0 * std::numbers::pi * path_nm * 1e-9;
  const auto gaussian = [&](double value, double position, double variance, double by) {
    return value * std::sqrt(2.0 * std::numbers::pi * variance) * std::cos(position * phase + by) *
           std::exp(-variance * squared(phase));
  };
  glm::dvec3 xyz(
      gaussian(5.4856e-13, 1.6810e+06, 4.3278e+09, shift.x) + gaussian(9.7470e-14, 2.2399e+06, 4.5282e+09, shift.x),
      gaussian(4.4201e-13, 1.7953e+06, 9.3046e+09, shift.y), gaussian(5.2481e-13, 2.2084e+06, 6.6121e+09, shift.z));
  xyz /= 1.0685e-7;
  constexpr glm::dmat3 kToRec709(3.2404542, -0.9692660, 0.0556434, -1.5371385, 1.8760108, -0.2040259, -0.4985314,
                                 0.0415560, 1.0572252);
  return kToRec709 * xyz;
}

}  // namespace

glm::dvec3 thin_film_fresnel(double cosine, double ior, double nm, const glm::dvec3& base_f0) {
  // Towards no film at all its index becomes that of the air.
  constexpr double kThinnest = 0.03;
  const double grown = std::clamp(nm / kThinnest, 0.0, 1.0);
  const double film = 1.0 + (ior - 1.0) * grown * grown * (3.0 - 2.0 * grown);
  const double sine2 = (1.0 - squared(std::min(cosine, 1.0))) / squared(film);
  if (!(sine2 <= 1.0)) return glm::dvec3(1.0);
  const double inside = std::sqrt(1.0 - sine2);

  const double first = fresnel_exact(std::clamp(cosine, 0.0, 1.0), film);
  const double through = 1.0 - first;
  const double half_turn = film < 1.0 ? 0.0 : std::numbers::pi;
  glm::dvec3 second(0.0);
  glm::dvec3 shift(0.0);
  for (int c = 0; c < 3; ++c) {
    const double base = index_of(base_f0[c]);
    second[c] = schlick(f0_between(base, film), inside);
    shift[c] = half_turn + (base < film ? std::numbers::pi : 0.0);
  }
  const glm::dvec3 both = glm::min(first * second, 0.9999);
  const glm::dvec3 returned = squared(through) * second / (1.0 - both);
  glm::dvec3 result = first + returned;
  glm::dvec3 order = returned - through;
  const double path = 2.0 * film * nm * inside;
  for (int m = 1; m <= 2; ++m) {
    order *= glm::sqrt(both);
    result += order * (2.0 * sensitivity(m * path, static_cast<double>(m) * shift));
  }
  return glm::clamp(result, 0.0, 1.0);
}

}  // namespace hpr
