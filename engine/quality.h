#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "rt/lighter.h"

namespace hpr {

/// What a word of --quality stands for; each setting has an option of its own, which wins. docs/quality.md has the same
/// table.
struct Quality {
  std::string_view name;
  std::uint32_t samples = 1;    ///< --spp
  int light_samples = 1;        ///< --light-samples
  int max_depth = 8;            ///< --max-depth
  double glossy_cutoff = 0.0;   ///< --glossy-cutoff
  std::uint32_t photons = 0;    ///< --photons
  bool global_photons = false;  ///< --indirect
};

/// From the fastest to the best.
[[nodiscard]] std::span<const Quality> all_qualities();

/// Throws Error (Usage) with the choices and the nearest one.
[[nodiscard]] const Quality& find_quality(const std::string& name);

}  // namespace hpr
