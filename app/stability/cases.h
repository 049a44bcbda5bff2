#pragma once

#include <vector>

#include "app/stability/stability.h"

/// What each file of app/stability/ measures.
namespace hpr::stability {

// depth.cpp
[[nodiscard]] std::vector<StabilityFinding> depth_order(const Globals& globals);

// watertight.cpp
[[nodiscard]] std::vector<StabilityFinding> watertight(const Globals& globals);

// acne.cpp
[[nodiscard]] std::vector<StabilityFinding> acne(const Globals& globals);

}  // namespace hpr::stability
