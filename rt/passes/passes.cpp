#include <algorithm>

#include "core/error.h"
#include "core/names.h"
#include "rt/passes/pass.h"

namespace hpr {

std::vector<std::unique_ptr<Pass>> make_all_passes() {
  std::vector<std::unique_ptr<Pass>> passes;
  passes.push_back(make_shadow_pass());
  passes.push_back(make_reflection_pass());
  passes.push_back(make_refraction_pass());
  passes.push_back(make_ambient_occlusion_pass());
  passes.push_back(make_photon_pass());
  passes.push_back(make_gather_pass());

  return passes;
}

std::vector<std::string> all_pass_names() {
  std::vector<std::string> names;
  for (const auto& pass : make_all_passes()) names.emplace_back(pass->name());
  return names;
}

bool runs_pass(std::span<const PassPlan> plan, std::string_view name) {
  return std::ranges::any_of(plan, [&](const PassPlan& pass) { return pass.runs && pass.name == name; });
}

bool lifts_origins(std::span<const PassPlan> plan, const RaySettings& settings) {
  return runs_pass(plan, "ambient-occlusion") || (settings.terminator_fix && runs_pass(plan, "shadow"));
}

namespace {

bool names_pass(const RaySettings& settings, std::string_view name) {
  return std::ranges::find(settings.passes, name) != settings.passes.end();
}

/// Throws Error (Usage) for names that are no passes, and for those that do not go together.
void check_names(const RaySettings& settings) {
  const std::vector<std::string> names = all_pass_names();
  for (const std::string& wanted : settings.passes) {
    if (std::ranges::find(names, wanted) == names.end()) {
      throw Error(ExitCode::Usage, "no ray pass is called '" + printable(wanted) + "'",
                  unknown_name_hint(wanted, names));
    }
  }
  if (names_pass(settings, "gather") && names_pass(settings, "photon")) {
    throw Error(ExitCode::Usage, "the passes gather and photon bring the same light", "name one of them");
  }
  if (names_pass(settings, "gather") && !settings.half_resolution.empty()) {
    throw Error(ExitCode::Usage, "what the pass gather brings belongs to single pixels, and none of it can be shared",
                "leave out --half-resolution, or name photon in place of gather");
  }
}

}  // namespace

std::vector<PassPlan> plan_passes(const Requirements& scene, const RaySettings& settings) {
  check_names(settings);
  std::vector<PassPlan> plan;
  for (const auto& pass : make_all_passes()) {
    const std::string name(pass->name());
    const Requirement requirement = pass->requirement(scene, settings);
    const bool wanted = names_pass(settings, name) ||
                        (settings.passes.empty() && settings.auto_passes && pass->runs_by_default(scene, settings));
    if (settings.reference) {
      plan.push_back({name, false, "the reference traces whole paths instead"});
      continue;
    }
    if (settings.all_passes && pass->runs_by_default(scene, settings)) {
      plan.push_back({name, true, requirement.needed ? requirement.why : "as asked, although " + requirement.why});
      continue;
    }
    plan.push_back(
        {name, wanted && requirement.needed, wanted ? requirement.why : "not asked for: " + requirement.why});
  }
  return plan;
}

}  // namespace hpr
