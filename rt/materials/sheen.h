#pragma once

#include <cstddef>
#include <span>

namespace hpr {

/// White sheen looked at from one side: Conty Estevez and Kulla, "Production Friendly Microfacet Sheen BRDF", 2017, as
/// KHR_materials_sheen has it, with alpha = roughness^2 of at least kMinAlpha. Cosines are to the normal, above 0.
class Sheen {
 public:
  Sheen(double roughness, double normal_view);

  /// f, 1/sr, by the cosines of the light and the half vector.
  [[nodiscard]] double value(double normal_light, double normal_half) const {
    return distribution(normal_half) * visibility(normal_light);
  }
  [[nodiscard]] double distribution(double normal_half) const;
  /// Shadowing over four times both cosines.
  [[nodiscard]] double visibility(double normal_light) const;

  static constexpr double kMinAlpha = 5e-3;

 private:
  [[nodiscard]] double fit(double cosine) const;
  [[nodiscard]] double lambda(double cosine) const;

  double inverse_alpha_;
  double a_ = 0.0;  ///< of the paper's fit of the shadowing, section 3
  double b_ = 0.0;
  double c_ = 0.0;
  double d_ = 0.0;
  double e_ = 0.0;
  double normal_view_;
  double lambda_view_ = 0.0;
};

/// The share of a furnace's light that white sheen reflects to a viewer whose direction has this cosine, 0 to 1. From a
/// table, which the first call computes: within 0.002, and 0.01 below a roughness or cosine of 0.1.
[[nodiscard]] double sheen_albedo(double roughness, double normal_view);

/// What sheen_albedo() interpolates: [root of the roughness][root of the cosine], kSheenSteps of each from 0 to 1.
[[nodiscard]] std::span<const double> sheen_albedo_table();
inline constexpr std::size_t kSheenSteps = 32;

}  // namespace hpr
