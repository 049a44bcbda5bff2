#include "app/stability/cases.h"

namespace hpr::stability {

std::vector<StabilityFinding> depth_order(const Globals& /*globals*/) {
  return {};
}

}  // namespace hpr::stability
