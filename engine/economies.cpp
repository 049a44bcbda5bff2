#include "engine/economies.h"

#include <algorithm>

#include "core/error.h"
#include "rt/passes/pass_list.h"

namespace hpr {
namespace {

constexpr const char* kHalfResolution = "half-resolution";
constexpr const char* kNoPhotons = "photons";
constexpr const char* kLessGlossy = "glossy-cutoff";

constexpr double kCheapCutoff = 0.1;
constexpr int kCheapDepth = 2;

/// Whether it brings light that surfaces scattered on to others.
bool is_indirect(const PassInfo& pass) {
  return pass.component == Component::Photon;
}

}  // namespace

std::vector<std::string> economies_of(const FrameSettings& settings, std::span<const PassPlan> passes) {
  std::vector<std::string> names;
  if (settings.rays.reference) return names;
  const bool shares_otherwise = settings.rays.denoise || runs_pass(passes, [](const PassInfo& pass) {
                                  return pass.half_resolution.components == 0;
                                });
  if (settings.shading == Shading::Deferred && !shares_otherwise) names.emplace_back(kHalfResolution);
  if (runs_pass(passes, is_indirect)) names.emplace_back(kNoPhotons);
  const bool costly = settings.rays.glossy_cutoff > kCheapCutoff || settings.rays.max_depth > kCheapDepth;
  if (costly && runs_pass(passes, [](const PassInfo& pass) { return pass.lobe.has_value(); })) {
    names.emplace_back(kLessGlossy);
  }
  return names;
}

FrameSettings economize(FrameSettings settings, std::span<const std::string> economies) {
  RaySettings& rays = settings.rays;
  for (const std::string& name : economies) {
    if (name == kHalfResolution) {
      rays.half_resolution = half_resolution_passes();
    } else if (name == kNoPhotons) {
      rays.photons = 0;
      rays.global_photons = false;
      const std::size_t given_up = std::erase_if(rays.passes, [](PassId pass) { return is_indirect(info_of(pass)); });
      if (given_up > 0 && rays.passes.empty()) rays.auto_passes = false;
    } else {
      HPR_CHECK(name == kLessGlossy);
      rays.glossy_cutoff = std::min(rays.glossy_cutoff, kCheapCutoff);
      rays.max_depth = std::min(rays.max_depth, kCheapDepth);
    }
  }
  return settings;
}

}  // namespace hpr
