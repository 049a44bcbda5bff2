#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace hpr {

/// How much time Embree spends on building its trees, from the least to the most.
enum class BuildQuality : std::uint8_t { Low, Medium, High };
inline constexpr std::array<std::string_view, 3> kBuildQualityNames{"low", "medium", "high"};

/// How Embree's scenes are made: what that costs and how fast rays are after, not what they meet.
struct RayBuild {
  BuildQuality quality = BuildQuality::Medium;
  /// Every rank traces by AVX2, so that all round alike. Else each by the widest instructions its processor has, whose
  /// distances may differ from AVX2's in the last bit.
  bool same_instructions = true;
  std::size_t max_bytes = 0;  ///< Embree may allocate, beyond which memory has run out; 0: as many as there are

  bool operator==(const RayBuild&) const = default;
};

}  // namespace hpr
