#include "engine/quality.h"

#include <algorithm>
#include <array>
#include <vector>

#include "core/error.h"
#include "core/names.h"

namespace hpr {
namespace {

constexpr std::array kQualities{
    Quality{.name = "draft", .samples = 1, .light_samples = 1, .max_depth = 2, .glossy_cutoff = 0.1, .photons = 0},
    Quality{.name = "good", .samples = 1, .light_samples = 1, .max_depth = 8, .glossy_cutoff = 0.3, .photons = 100'000},
    Quality{.name = "best",
            .samples = 64,
            .light_samples = 2,
            .max_depth = 16,
            .glossy_cutoff = 1.0,
            .photons = 200'000,
            .global_photons = true},
};

}  // namespace

std::span<const Quality> all_qualities() {
  return kQualities;
}

const Quality& find_quality(const std::string& name) {
  const auto found = std::ranges::find(kQualities, name, &Quality::name);
  if (found != kQualities.end()) return *found;
  std::vector<std::string> choices;
  choices.reserve(kQualities.size());
  for (const Quality& quality : kQualities) choices.emplace_back(quality.name);
  throw Error(ExitCode::Usage, "unknown quality '" + printable(name) + "'", unknown_name_hint(name, choices));
}

}  // namespace hpr
