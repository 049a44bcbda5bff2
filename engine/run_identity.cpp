#include "engine/run_identity.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <hpr/version.h>

#include <array>

#include "core/hash.h"

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
                        const Sampling& sampling, bool keeps_keys) {
  const RaySettings& rays = plan.rays;
  RunIdentity identity{
      {"program", fmt::format("hpr {} ({})", kVersion, kCommit)},
      {"scene", hex16(content_hash(session.scene()))},
      {"seed", fmt::format("{}", rays.seed)},
      {"filter", std::string(name_of(sampling.filter.value_or(PixelFilter::Box)))},
      {"shading", plan.shading == Shading::Local ? "local" : "deferred"},
  };
  for (std::size_t i = 0; i < views.size(); ++i) {
    identity.emplace_back(fmt::format("view {}", i), describe(views[i]));
  }
  std::vector<std::string> passes;
  for (const PassPlan& pass : plan_passes(session.requirements(), rays)) {
    if (pass.runs) passes.push_back(pass.name);
  }
  identity.emplace_back("list of passes", fmt::format("'{}'", fmt::join(passes, ",")));
  identity.emplace_back(kKeys, plan.primary == Primary::Rays ? kByRays : kByRaster);
  identity.emplace_back("depth format", std::string(kDepthFormatNames.at(static_cast<std::size_t>(plan.depth_format))));
  identity.emplace_back("light", rays.reference ? "the reference" : "passes");
  identity.emplace_back("instructions of rays", rays.build.same_instructions ? "the same everywhere" : "the widest");
  identity.emplace_back("depth", fmt::format("{}", rays.max_depth));
  identity.emplace_back("samples of lights", fmt::format("{}", rays.light_samples));
  identity.emplace_back("glossy cutoff", fmt::format("{}", rays.glossy_cutoff));
  identity.emplace_back("photons", fmt::format("{}{} of radius {}", rays.photons, rays.global_photons ? " global" : "",
                                               rays.photon_radius));
  identity.emplace_back("ambient light", fmt::format("{} by {} rays", rays.ambient, rays.occlusion_rays));
  identity.emplace_back("list at half resolution", fmt::format("'{}'", fmt::join(rays.half_resolution, ",")));
  identity.emplace_back("denoiser", rays.denoise ? "on" : "off");
  identity.emplace_back("terminator fix", rays.terminator_fix ? "on" : "off");
  std::vector<std::string_view> aovs;
  for (const Aov aov : plan.aovs) aovs.push_back(name_of(aov));
  identity.emplace_back("list of AOVs", fmt::format("'{}'", fmt::join(aovs, ",")));
  const std::string goal = sampling.goal.samples ? fmt::format("{}", *sampling.goal.samples) : "open";
  identity.emplace_back("number of adaptive samples", sampling.adaptive ? goal : "none");
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
