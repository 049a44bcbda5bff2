#pragma once

#include <vector>

#include "tools/stability/stability.h"

/// What each file of app/stability/ measures.
namespace hpr::stability {

// Geometry, rasterisation and frames.
[[nodiscard]] std::vector<StabilityFinding> depth_order(const Globals& globals);      // depth.cpp
[[nodiscard]] std::vector<StabilityFinding> crossing_planes(const Globals& globals);  // crossing.cpp
[[nodiscard]] std::vector<StabilityFinding> coplanar(const Globals& globals);         // coplanar.cpp
[[nodiscard]] std::vector<StabilityFinding> slivers(const Globals& globals);          // slivers.cpp
[[nodiscard]] std::vector<StabilityFinding> slanted_planes(const Globals& globals);   // slanted.cpp
[[nodiscard]] std::vector<StabilityFinding> offset(const Globals& globals);           // offset.cpp
[[nodiscard]] std::vector<StabilityFinding> scale(const Globals& globals);            // scale.cpp
[[nodiscard]] std::vector<StabilityFinding> nodes(const Globals& globals);            // nodes.cpp
[[nodiscard]] std::vector<StabilityFinding> frusta(const Globals& globals);           // frusta.cpp
[[nodiscard]] std::vector<StabilityFinding> giant(const Globals& globals);            // giant.cpp
[[nodiscard]] std::vector<StabilityFinding> tiny(const Globals& globals);             // tiny.cpp
[[nodiscard]] std::vector<StabilityFinding> degenerate(const Globals& globals);       // degenerate.cpp
[[nodiscard]] std::vector<StabilityFinding> layers(const Globals& globals);           // layers.cpp
[[nodiscard]] std::vector<StabilityFinding> frames(const Globals& globals);           // frames.cpp

// watertight.cpp
[[nodiscard]] std::vector<StabilityFinding> watertight(const Globals& globals);

// acne.cpp
[[nodiscard]] std::vector<StabilityFinding> acne(const Globals& globals);

// accumulator.cpp
[[nodiscard]] std::vector<StabilityFinding> accumulator(const Globals& globals);

// photons.cpp
[[nodiscard]] std::vector<StabilityFinding> photons(const Globals& globals);

// mirrors.cpp
[[nodiscard]] std::vector<StabilityFinding> mirrors(const Globals& globals);

// lights.cpp
[[nodiscard]] std::vector<StabilityFinding> lights(const Globals& globals);

// materials.cpp
[[nodiscard]] std::vector<StabilityFinding> materials(const Globals& globals);

// not_finite.cpp
[[nodiscard]] std::vector<StabilityFinding> not_finite(const Globals& globals);

}  // namespace hpr::stability
