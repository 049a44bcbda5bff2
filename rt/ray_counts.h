#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "rt/passes/pass_id.h"
#include "rt/sampling/sampler.h"

namespace hpr {

/// What the last PrimaryRays::draw() counted.
struct PrimaryRayStats {
  std::uint64_t rays = 0;      ///< none go through pixels where no box about triangles is seen
  std::uint64_t invalid = 0;   ///< rays that Embree cannot trace (is_traceable): they missed
  std::uint64_t weighed = 0;   ///< depths computed in double because two candidates, or the near plane, were close
  std::uint64_t retraced = 0;  ///< rays traced again through everything, as their first candidate was no hit

  PrimaryRayStats& operator+=(const PrimaryRayStats& other) {
    rays += other.rays;
    invalid += other.invalid;
    weighed += other.weighed;
    retraced += other.retraced;
    return *this;
  }
};

/// Rays traced, by kind, and what had to be left out.
struct RayCounts {
  std::uint64_t primary = 0;                    ///< from the eye: no pass counts them
  std::array<std::uint64_t, kPasses> passes{};  ///< by PassId
  std::uint64_t invalid = 0;                    ///< rays above that Embree cannot trace (is_traceable): they missed
  std::uint64_t cut = 0;                        ///< rays that ended among surfaces of partial coverage, see kMaxPassed
  std::uint64_t not_finite = 0;                 ///< pixels whose radiance was no finite number: they are black
  ScreenPixel first_not_finite;  ///< the first such pixel by screen and row, on any thread; else kNoPixel

  [[nodiscard]] std::uint64_t& operator[](PassId pass) { return passes.at(static_cast<std::size_t>(pass)); }
  [[nodiscard]] std::uint64_t operator[](PassId pass) const { return passes.at(static_cast<std::size_t>(pass)); }

  RayCounts& operator+=(const RayCounts& other);
  bool operator==(const RayCounts&) const = default;
};

struct PassTime {
  std::string name;                 ///< a pass, or another step: "surface" and "direct" always run
  double ms = 0.0;                  ///< summed over threads
  std::optional<PassId> pass = {};  ///< none: another step
};

}  // namespace hpr
