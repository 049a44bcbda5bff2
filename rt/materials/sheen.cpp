#include "rt/materials/sheen.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "rt/materials/microfacets.h"

namespace hpr {

Sheen::Sheen(double roughness, double normal_view) : normal_view_(normal_view) {
  const double alpha = std::max(squared(roughness), kMinAlpha);
  inverse_alpha_ = 1.0 / alpha;
  const double smooth = squared(1.0 - alpha);
  const auto mix = [&](double rough_end, double smooth_end) { return rough_end + (smooth_end - rough_end) * smooth; };
  a_ = mix(21.5473, 25.3245);
  b_ = mix(3.82987, 3.32435);
  c_ = mix(0.19823, 0.16801);
  d_ = mix(-1.97760, -1.27393);
  e_ = mix(-4.32054, -4.85967);
  lambda_view_ = lambda(normal_view);
}

double Sheen::fit(double cosine) const {
  return a_ / (1.0 + b_ * std::pow(cosine, c_)) + d_ * cosine + e_;
}

double Sheen::lambda(double cosine) const {
  return cosine < 0.5 ? std::exp(fit(cosine)) : std::exp(2.0 * fit(0.5) - fit(1.0 - std::min(cosine, 1.0)));
}

double Sheen::distribution(double normal_half) const {
  const double sine2 = std::max(0.0, 1.0 - squared(normal_half));
  return (2.0 + inverse_alpha_) * std::pow(sine2, 0.5 * inverse_alpha_) / (2.0 * std::numbers::pi);
}

double Sheen::visibility(double normal_light) const {
  return 1.0 / ((1.0 + lambda_view_ + lambda(normal_light)) * 4.0 * normal_view_ * normal_light);
}

namespace {

constexpr std::size_t kSteps = kSheenSteps;
/// Rows of the root of the roughness by that of the cosine: dense where the albedo changes most.
using AlbedoTable = std::array<double, kSteps * kSteps>;

/// By the midpoint rule over the light's cosine, dense where it grazes, and half of the circle.
double integrate(double roughness, double normal_view) {
  constexpr int kRings = 32;
  constexpr int kSectors = 32;
  const Sheen sheen(roughness, normal_view);
  const double sine_view = std::sqrt(1.0 - squared(normal_view));
  double sum = 0.0;
  for (int i = 0; i < kRings; ++i) {
    const double u = (i + 0.5) / kRings;
    const double normal_light = u * u;
    const double sine_light = std::sqrt(1.0 - squared(normal_light));
    double ring = 0.0;
    for (int j = 0; j < kSectors; ++j) {
      const double around = std::numbers::pi * (j + 0.5) / kSectors;
      const double dot = sine_view * sine_light * std::cos(around) + normal_view * normal_light;
      ring += sheen.distribution((normal_view + normal_light) / std::sqrt(2.0 + 2.0 * dot));
    }
    sum += ring * sheen.visibility(normal_light) * normal_light * 2.0 * u / kRings;
  }
  return sum * 2.0 * std::numbers::pi / kSectors;
}

AlbedoTable make_table() {
  constexpr double kMinCosine = 1e-4;
  AlbedoTable table{};
  for (std::size_t row = 0; row < kSteps; ++row) {
    for (std::size_t column = 0; column < kSteps; ++column) {
      const double root = static_cast<double>(column) / (kSteps - 1);
      const double cosine = std::max(squared(root), kMinCosine);
      // Smooth where grazing light would be more than arrives, so that what lies between is right.
      table[row * kSteps + column] = integrate(squared(static_cast<double>(row) / (kSteps - 1)), cosine);
    }
  }
  return table;
}

}  // namespace

std::span<const double> sheen_albedo_table() {
  static const AlbedoTable table = make_table();
  return table;
}

double sheen_albedo(double roughness, double normal_view) {
  const std::span<const double> table = sheen_albedo_table();
  const auto index_of = [](double value) { return std::clamp(value, 0.0, 1.0) * (kSteps - 1); };
  const double y = index_of(std::sqrt(std::max(roughness, 0.0)));
  const double x = index_of(std::sqrt(std::max(normal_view, 0.0)));
  const auto row = std::min(static_cast<std::size_t>(y), kSteps - 2);
  const auto column = std::min(static_cast<std::size_t>(x), kSteps - 2);
  const double fy = y - static_cast<double>(row);
  const double fx = x - static_cast<double>(column);
  const auto along = [&](std::size_t r) {
    return table[r * kSteps + column] * (1.0 - fx) + table[r * kSteps + column + 1] * fx;
  };
  return std::clamp(along(row) * (1.0 - fy) + along(row + 1) * fy, 0.0, 1.0);
}

}  // namespace hpr
