#include "scene/generators/portable_math.h"

#include <cmath>
#include <cstdint>
#include <numbers>

namespace hpr::portable {
namespace {

/// Taylor series for |x| <= pi / 4, where the first term left out is below 1e-17.
double sin_near_zero(double x) {
  double sum = 0.0;
  for (int n = 17; n >= 3; n -= 2) sum = (1.0 + sum) * (-x * x / (n * (n - 1.0)));
  return x + x * sum;
}
double cos_near_zero(double x) {
  double sum = 0.0;
  for (int n = 18; n >= 2; n -= 2) sum = (1.0 + sum) * (-x * x / (n * (n - 1.0)));
  return 1.0 + sum;
}

}  // namespace

double sin_turns(double turns) {
  const double quarters = std::floor(4.0 * turns + 0.5);
  const double x = (turns - 0.25 * quarters) * (2.0 * std::numbers::pi);
  switch (static_cast<std::int64_t>(quarters) & 3) {
    case 0:
      return sin_near_zero(x);
    case 1:
      return cos_near_zero(x);
    case 2:
      return -sin_near_zero(x);
    default:
      return -cos_near_zero(x);
  }
}

double cos_turns(double turns) {
  return sin_turns(turns + 0.25);
}

double exp2(double x) {
  const double whole = std::floor(x + 0.5);
  const double y = (x - whole) * std::numbers::ln2;
  double sum = 0.0;
  for (int n = 16; n >= 1; --n) sum = (1.0 + sum) * (y / n);
  return std::ldexp(1.0 + sum, static_cast<int>(whole));
}

}  // namespace hpr::portable
