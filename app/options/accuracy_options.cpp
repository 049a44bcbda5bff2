#include "app/options/accuracy_options.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <span>
#include <vector>

#include "core/error.h"
#include "core/names.h"

namespace hpr {
namespace {

/// Where `name` stands among `names`.
std::size_t choose(const std::string& option, const std::string& name, std::span<const std::string_view> names) {
  const auto found = std::ranges::find(names, name);
  if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
  const std::vector<std::string> choices(names.begin(), names.end());
  throw Error(ExitCode::Usage, fmt::format("{}: there is no '{}'", option, printable(name)),
              unknown_name_hint(printable(name), choices));
}

}  // namespace

void RayBuildOptions::declare(CLI::App& app) {
  app.add_option("--embree-quality", embree_quality, "low, medium or high: what Embree spends on building its trees")
      ->capture_default_str();
  app.add_option("--deterministic", deterministic,
                 "on: rays have the same bits on every machine; off: each rank traces by its widest instructions")
      ->capture_default_str();
}

RayBuild RayBuildOptions::build() const {
  constexpr std::array<std::string_view, 2> kSwitch{"off", "on"};
  RayBuild build;
  build.quality = static_cast<BuildQuality>(choose("--embree-quality", embree_quality, kBuildQualityNames));
  build.same_instructions = choose("--deterministic", deterministic, kSwitch) == 1;
  return build;
}

void WireOptions::declare(CLI::App& app) {
  app.add_option("--depth-format", depth_format, "bits of a depth where layers are composited: 32f, 24 or 16")
      ->capture_default_str();
  app.add_option("--color-format", color_format, "how the colours of an .exr are sent to rank 0: 32f, 16f or 8")
      ->capture_default_str();
}

ColorFormat WireOptions::colors() const {
  return static_cast<ColorFormat>(choose("--color-format", color_format, kColorFormatNames));
}

DepthFormat WireOptions::depths() const {
  return static_cast<DepthFormat>(choose("--depth-format", depth_format, kDepthFormatNames));
}

}  // namespace hpr
