#include "app/stability/cases.h"

#include <array>

namespace hpr {

std::span<const StabilityCase> all_stability_cases() {
  static const std::array kCases{
      StabilityCase{"depth-order", "pairs of close surfaces from 1 mm to 10 000 km: the nearer one is seen",
                    stability::depth_order},
  };
  return kCases;
}

}  // namespace hpr
