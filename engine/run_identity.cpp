#include "engine/run_identity.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <hpr/version.h>

#include <array>

#include "core/bytes.h"
#include "engine/settings_table.h"

namespace hpr {
namespace {

constexpr const char* kKeys = "way to keys";
constexpr const char* kByRays = "by rays";
constexpr const char* kByRaster = "by raster";

/// Every bit of a view but its jitter, which belongs to the sample.
std::string describe(const View& view) {
  std::array<double, 17> numbers{view.eye.x, view.eye.y, view.eye.z};
  for (int column = 0; column < 3; ++column) {
    for (int row = 0; row < 3; ++row)
      numbers.at(3 + 3 * static_cast<std::size_t>(column) + static_cast<std::size_t>(row)) = view.axes[column][row];
  }
  numbers[12] = view.left;
  numbers[13] = view.right;
  numbers[14] = view.bottom;
  numbers[15] = view.top;
  numbers[16] = view.near_distance;
  return fmt::format("{}x{}+{}+{} of {}x{} number {} {} far {} {}", view.block.width(), view.block.height(),
                     view.block.x0, view.block.y0, view.screen.width, view.screen.height, view.screen_number,
                     view.orthographic ? "orthographic" : "perspective", view.far_distance,
                     hex16(xxh64(std::as_bytes(std::span(numbers)))));
}

}  // namespace

RunIdentity identity_of(const Session& session, const FramePlan& plan, std::span<const View> views,
                        const RenderSettings& settings, bool keeps_keys) {
  RunIdentity identity{
      {"program", fmt::format("hpr {} ({})", kVersion, kCommit)},
      {"scene", hex16(content_hash(session.scene()))},
      {"seed", fmt::format("{}", plan.rays.seed)},
  };
  for (std::size_t i = 0; i < views.size(); ++i) {
    identity.emplace_back(fmt::format("view {}", i), describe(views[i]));
  }
  std::vector<std::string_view> passes;
  for (const PassPlan& pass : plan_passes(session.requirements(), plan.rays)) {
    if (pass.runs) passes.push_back(name_of(pass.pass));
  }
  identity.emplace_back("list of passes", fmt::format("'{}'", fmt::join(passes, ",")));
  identity.emplace_back("number of photons", fmt::format("{}", plan.rays.photons));
  identity.emplace_back(kKeys, plan.primary == Primary::Rays ? kByRays : kByRaster);
  for (const Setting& setting : all_settings()) {
    if (setting.decides_bits) {
      identity.emplace_back(fmt::format("--{}", setting.name), fmt::format("'{}'", setting.value.write(settings)));
    }
  }
  const SampleGoal& goal = settings.sampling.goal;
  const std::string samples = goal.samples ? fmt::format("{}", *goal.samples) : "open";
  identity.emplace_back("number of adaptive samples", settings.sampling.adaptive ? samples : "none");
  identity.emplace_back("--raw", keeps_keys ? "given" : "left out");
  return identity;
}

Primary primary_of(const RunIdentity& identity) {
  for (const auto& [field, value] : identity) {
    if (field != kKeys) continue;
    if (value == kByRays) return Primary::Rays;
    if (value == kByRaster) return Primary::Raster;
  }
  return Primary::Auto;
}

}  // namespace hpr
