#include "app/stability/cases.h"

#include <array>

namespace hpr {

std::span<const StabilityCase> all_stability_cases() {
  static const std::array kCases{
      StabilityCase{"depth-order", "pairs of close surfaces from 1 mm to 10 000 km: the nearer one is seen",
                    stability::depth_order},
      StabilityCase{"watertight", "rays aimed at shared edges and vertices of a closed mesh: none gets through",
                    stability::watertight},
      StabilityCase{"acne", "light at 89.9 degrees and covers close above floors: no false shadow, no leak",
                    stability::acne},
  };
  return kCases;
}

}  // namespace hpr
