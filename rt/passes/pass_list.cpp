#include "rt/passes/pass_list.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "core/error.h"
#include "core/text.h"
#include "rt/passes/pass.h"
#include "rt/photons/photon_query.h"
#include "rt/show/show.h"

namespace hpr {
namespace {

/// Of a lobe and the one that extensions add to it.
glm::dvec3 weight_of(const PathVertex& point, Lobe lobe) {
  const glm::dvec3 weight = point.bsdf.weight(lobe);
  return point.bsdf.is_extended() ? weight + point.bsdf.weight(extension_of(lobe)) : weight;
}

glm::dvec3 diffuse_and_specular(const PathVertex& point) {
  return point.bsdf.weight(Lobe::Diffuse) + weight_of(point, Lobe::Reflection);
}

constexpr std::array<PassInfo, kPasses> kAllPasses{
    PassInfo{
        .id = PassId::Shadow,
        .name = "shadow",
        .component = Component::Shadow,
        .pattern = RayPattern::Shadow,
        .lift = OriginLift::WithTerminatorFix,
        .half_resolution = {set_of(Component::Direct, Component::Shadow),
                            [](const PathVertex& point, double /*glossy_cutoff*/) {
                              return diffuse_and_specular(point);
                            }},
        .required_by = &Requirements::shadow,
        .make = make_shadow_pass,
    },
    PassInfo{
        .id = PassId::Reflection,
        .name = "reflection",
        .component = Component::Reflection,
        .pattern = RayPattern::Mirror,
        .lobe = Lobe::Reflection,
        .half_resolution = {set_of(Component::Reflection),
                            [](const PathVertex& point, double /*glossy_cutoff*/) {
                              return weight_of(point, Lobe::Reflection);
                            }},
        .required_by = &Requirements::reflection,
        .make = make_reflection_pass,
    },
    PassInfo{
        .id = PassId::Refraction,
        .name = "refraction",
        .component = Component::Refraction,
        .pattern = RayPattern::Mirror,
        .lobe = Lobe::Transmission,
        .half_resolution = {set_of(Component::Refraction),
                            [](const PathVertex& point, double /*glossy_cutoff*/) {
                              return weight_of(point, Lobe::Transmission);
                            }},
        .required_by = &Requirements::refraction,
        .make = make_refraction_pass,
    },
    PassInfo{
        .id = PassId::AmbientOcclusion,
        .name = "ambient-occlusion",
        .component = Component::AmbientOcclusion,
        .pattern = RayPattern::Diffuse,
        .lift = OriginLift::Always,
        .half_resolution = {set_of(Component::AmbientOcclusion),
                            [](const PathVertex& point, double /*glossy_cutoff*/) {
                              return point.bsdf.weight(Lobe::Diffuse) * point.material.occlusion;
                            }},
        .make = make_ambient_occlusion_pass,
    },
    PassInfo{
        .id = PassId::Photon,
        .name = "photon",
        .component = Component::Photon,
        .pattern = RayPattern::Diffuse,
        .needs_photons = true,
        .half_resolution = {set_of(Component::Photon),
                            [](const PathVertex& point, double glossy_cutoff) {
                              return is_followed(point.bsdf, Lobe::Reflection, glossy_cutoff)
                                         ? point.bsdf.weight(Lobe::Diffuse)
                                         : diffuse_and_specular(point);
                            }},
        .required_by = &Requirements::photon,
        .make = make_photon_pass,
    },
    PassInfo{
        .id = PassId::Gather,
        .name = "gather",
        .component = Component::Photon,
        .pattern = RayPattern::Diffuse,
        .gathers_all_lobes = true,
        .make = make_gather_pass,
    },
};

constexpr bool is_in_order() {
  for (std::size_t i = 0; i < kPasses; ++i) {
    if (kAllPasses[i].id != static_cast<PassId>(i)) return false;
  }
  return true;
}
static_assert(is_in_order(), "a row per pass, in the order of PassId");

bool names_pass(const RaySettings& settings, PassId pass) {
  return std::ranges::find(settings.passes, pass) != settings.passes.end();
}

/// Another pass that brings the same light; null where there is none.
const PassInfo* alternative_to(const PassInfo& pass) {
  const auto found = std::ranges::find_if(
      kAllPasses, [&](const PassInfo& other) { return other.id != pass.id && other.component == pass.component; });
  return found == kAllPasses.end() ? nullptr : &*found;
}

/// Throws Error (Usage) for passes of `settings` that do not go together.
void check_combination(const RaySettings& settings) {
  for (std::size_t i = kAllPasses.size(); i-- > 0;) {
    const PassInfo& pass = kAllPasses.at(i);
    if (!names_pass(settings, pass.id)) continue;
    const PassInfo* const other = alternative_to(pass);
    if (other != nullptr && names_pass(settings, other->id)) {
      throw Error(ExitCode::Usage, fmt::format("the passes {} and {} bring the same light", pass.name, other->name),
                  "name one of them");
    }
    if (!settings.half_resolution.empty() && pass.half_resolution.components == 0) {
      const std::string in_place =
          other != nullptr ? fmt::format(", or name {} in place of {}", other->name, pass.name) : "";
      throw Error(
          ExitCode::Usage,
          fmt::format("what the pass {} brings belongs to single pixels, and none of it can be shared", pass.name),
          "leave out --half-resolution" + in_place);
    }
  }
}

}  // namespace

std::span<const PassInfo, kPasses> all_passes() {
  return kAllPasses;
}

const PassInfo& info_of(PassId pass) {
  return kAllPasses.at(static_cast<std::size_t>(pass));
}

std::string_view name_of(PassId pass) {
  return info_of(pass).name;
}

std::vector<std::string_view> names_of(std::span<const PassId> passes) {
  std::vector<std::string_view> names;
  names.reserve(passes.size());
  for (const PassId pass : passes) names.push_back(name_of(pass));
  return names;
}

std::string_view name_of(Component component) {
  const auto found = std::ranges::find(kAllPasses, component, &PassInfo::component);
  return found == kAllPasses.end() ? "direct" : found->name;
}

std::string_view name_of(RayPattern pattern) {
  constexpr std::array<std::string_view, 4> kNames{"primary", "shadow", "mirror", "diffuse"};
  return kNames.at(static_cast<std::size_t>(pattern));
}

std::optional<PassId> find_pass(std::string_view name) {
  const auto found = std::ranges::find(kAllPasses, name, &PassInfo::name);
  return found == kAllPasses.end() ? std::nullopt : std::optional(found->id);
}

PassId parse_pass(std::string_view name, std::span<const std::string> other_words) {
  if (const std::optional<PassId> pass = find_pass(name)) return *pass;
  std::vector<std::string> choices(other_words.begin(), other_words.end());
  for (const PassInfo& pass : kAllPasses) choices.emplace_back(pass.name);
  throw Error(ExitCode::Usage, fmt::format("no ray pass is called '{}'", printable(name)),
              unknown_name_hint(name, choices));
}

PassId parse_half_resolution_pass(std::string_view name) {
  const std::optional<PassId> pass = find_pass(name);
  if (pass && info_of(*pass).half_resolution.components != 0) return *pass;
  const std::vector<std::string_view> names = names_of(half_resolution_passes());
  const std::vector<std::string> choices(names.begin(), names.end());
  throw Error(ExitCode::Usage, fmt::format("no pass called '{}' runs at half resolution", printable(name)),
              unknown_name_hint(name, choices));
}

std::vector<PassId> half_resolution_passes() {
  std::vector<PassId> passes;
  for (const PassInfo& pass : kAllPasses) {
    if (pass.half_resolution.components != 0) passes.push_back(pass.id);
  }
  return passes;
}

ComponentSet shared_components(const RaySettings& settings) {
  ComponentSet components = 0;
  for (const PassId pass : settings.half_resolution) components |= info_of(pass).half_resolution.components;
  return components;
}

std::vector<PassPlan> plan_passes(const Requirements& scene, const RaySettings& settings) {
  check_combination(settings);
  std::vector<PassPlan> plan;
  for (const PassInfo& info : kAllPasses) {
    const std::unique_ptr<Pass> pass = info.make();
    const Requirement requirement = pass->requirement(scene, settings);
    const bool by_default = pass->runs_by_default(scene, settings);
    const bool wanted =
        names_pass(settings, info.id) || (settings.passes.empty() && settings.auto_passes && by_default);
    if (!needs_light(settings.show)) {
      plan.push_back({info.id, false, fmt::format("the picture shows {} in place of light", name_of(settings.show))});
      continue;
    }
    if (settings.reference) {
      plan.push_back({info.id, false, "the reference traces whole paths instead"});
      continue;
    }
    if (settings.all_passes && by_default) {
      plan.push_back({info.id, true, requirement.needed ? requirement.why : "as asked, although " + requirement.why});
      continue;
    }
    plan.push_back(
        {info.id, wanted && requirement.needed, wanted ? requirement.why : "not asked for: " + requirement.why});
  }
  return plan;
}

bool runs_pass(std::span<const PassPlan> plan, PassId pass) {
  return std::ranges::any_of(plan, [&](const PassPlan& planned) { return planned.runs && planned.pass == pass; });
}

bool runs_pass(std::span<const PassPlan> plan, bool (*matches)(const PassInfo& pass)) {
  return std::ranges::any_of(plan,
                             [&](const PassPlan& planned) { return planned.runs && matches(info_of(planned.pass)); });
}

bool traces_rays_beside_keys(const Requirements& scene, const RaySettings& settings) {
  return traces_own_rays(settings.show) || std::ranges::any_of(plan_passes(scene, settings), &PassPlan::runs);
}

bool lifts_origins(std::span<const PassPlan> plan, const RaySettings& settings) {
  return std::ranges::any_of(plan, [&](const PassPlan& planned) {
    const OriginLift lift = info_of(planned.pass).lift;
    return planned.runs &&
           (lift == OriginLift::Always || (lift == OriginLift::WithTerminatorFix && settings.terminator_fix));
  });
}

}  // namespace hpr
