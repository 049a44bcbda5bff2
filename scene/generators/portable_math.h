#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

/// Transcendental functions made of IEEE additions and multiplications only: the same bits with every compiler and C
/// library, which std::sin and its kin do not promise. For generated scenes, whose hash must agree between machines.
namespace hpr::portable {
namespace detail {

/// Taylor series for |x| <= pi / 4, where the first term left out is below 1e-17.
[[nodiscard]] inline double sin_near_zero(double x) {
  double sum = 0.0;
  for (int n = 17; n >= 3; n -= 2) sum = (1.0 + sum) * (-x * x / (n * (n - 1.0)));
  return x + x * sum;
}
[[nodiscard]] inline double cos_near_zero(double x) {
  double sum = 0.0;
  for (int n = 18; n >= 2; n -= 2) sum = (1.0 + sum) * (-x * x / (n * (n - 1.0)));
  return 1.0 + sum;
}

}  // namespace detail

/// Sine and cosine of `turns` full turns (one turn = 2 pi radians); absolute error below 1e-15 for |turns| < 1e6.
[[nodiscard]] inline double sin_turns(double turns) {
  const double quarters = std::floor(4.0 * turns + 0.5);
  const double x = (turns - 0.25 * quarters) * (2.0 * std::numbers::pi);
  switch (static_cast<std::int64_t>(quarters) & 3) {
    case 0:
      return detail::sin_near_zero(x);
    case 1:
      return detail::cos_near_zero(x);
    case 2:
      return -detail::sin_near_zero(x);
    default:
      return -detail::cos_near_zero(x);
  }
}

[[nodiscard]] inline double cos_turns(double turns) {
  return sin_turns(turns + 0.25);
}

/// 2 to the power of `x`; relative error below 1e-15 for |x| < 1000.
[[nodiscard]] inline double exp2(double x) {
  const double whole = std::floor(x + 0.5);
  const double y = (x - whole) * std::numbers::ln2;
  double sum = 0.0;
  for (int n = 16; n >= 1; --n) sum = (1.0 + sum) * (y / n);
  return std::ldexp(1.0 + sum, static_cast<int>(whole));
}

}  // namespace hpr::portable
