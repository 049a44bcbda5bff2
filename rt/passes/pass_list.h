#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rt/passes/pass_id.h"
#include "scene/requirements.h"

/// The ray passes there are. To add one: its file beside this one (those that follow lobes share lobe_passes.cpp), its
/// PassId and maker in pass_id.h (a Component too, where its light has a layer of its own), its row in pass_list.cpp
/// and its line in rt/CMakeLists.txt.
namespace hpr {

class Pass;
enum class Lobe : std::uint8_t;
struct PathVertex;
struct RaySettings;

/// A set of components: bit i stands for component i.
using ComponentSet = std::uint8_t;
static_assert(kComponents <= 8);

template <typename... Components>
[[nodiscard]] constexpr ComponentSet set_of(Components... components) {
  return static_cast<ComponentSet>(((1U << static_cast<unsigned>(components)) | ... | 0U));
}
[[nodiscard]] constexpr bool contains(ComponentSet set, Component component) {
  return (set & set_of(component)) != 0;
}

/// Components that count as diffuse where the denoiser filters diffuse and specular light apart.
inline constexpr ComponentSet kDiffuseComponents = set_of(Component::AmbientOcclusion, Component::Photon);

/// How the rays of a batch lie to each other, as `hpr bench rays` measures bare Embree: from one eye; to a light, any
/// hit; mirrored by surfaces; scattered by them.
enum class RayPattern : std::uint8_t { Primary, Shadow, Mirror, Diffuse };

/// When the rays of a pass leave from lifted origins, see SurfacePoint::lift.
enum class OriginLift : std::uint8_t { Never, WithTerminatorFix, Always };

/// What a pass shares among pixels at half resolution (RaySettings::half_resolution).
struct HalfResolution {
  ComponentSet components = 0;  ///< of the first surface; empty: its light belongs to single pixels
  /// How much of such light a point scatters towards the eye.
  glm::dvec3 (*scattered)(const PathVertex& point, double glossy_cutoff) = nullptr;
};

/// What there is to know about a pass without running it.
struct PassInfo {
  PassId id = PassId::Shadow;
  std::string_view name;                     ///< on the command line and in reports, of its rays as well
  Component component = Component::Shadow;   ///< where its light of the first surface counts
  RayPattern pattern = RayPattern::Diffuse;  ///< `hpr bench frame` compares its rays with such rays
  std::optional<Lobe> lobe = {};             ///< whose light it brings by a ray that follows it
  bool gathers_all_lobes = false;            ///< whether it follows all lobes that no other pass follows
  bool needs_photons = false;                ///< its rays are those of photons
  OriginLift lift = OriginLift::Never;       ///< of the rays it traces
  HalfResolution half_resolution = {};
  Requirement Requirements::*required_by = nullptr;  ///< `hpr scene info` reports it; null: no scene requires the pass
  std::unique_ptr<Pass> (*make)() = nullptr;
};

/// All passes, in the order of PassId.
[[nodiscard]] std::span<const PassInfo, kPasses> all_passes();
[[nodiscard]] const PassInfo& info_of(PassId pass);
[[nodiscard]] std::string_view name_of(PassId pass);
[[nodiscard]] std::vector<std::string_view> names_of(std::span<const PassId> passes);
/// "direct", or the name of the first pass whose light counts there.
[[nodiscard]] std::string_view name_of(Component component);
[[nodiscard]] std::string_view name_of(RayPattern pattern);

[[nodiscard]] std::optional<PassId> find_pass(std::string_view name);
/// Throws Error (Usage) for a name that is no pass, with the nearest of the passes and the `other_words`, which a
/// caller takes in their place.
[[nodiscard]] PassId parse_pass(std::string_view name, std::span<const std::string> other_words = {});
/// Throws Error (Usage) for a name that is no pass whose light can be shared among pixels.
[[nodiscard]] PassId parse_half_resolution_pass(std::string_view name);

/// The passes whose light can be shared among pixels.
[[nodiscard]] std::vector<PassId> half_resolution_passes();
/// The components that passes of RaySettings::half_resolution share.
[[nodiscard]] ComponentSet shared_components(const RaySettings& settings);

/// Every pass, in the order they run, for a scene that requires so much. Throws Error (Usage) where passes that
/// `settings` name do not go together.
[[nodiscard]] std::vector<PassPlan> plan_passes(const Requirements& scene, const RaySettings& settings);

[[nodiscard]] bool runs_pass(std::span<const PassPlan> plan, PassId pass);
/// Whether a pass runs whose row `matches`.
[[nodiscard]] bool runs_pass(std::span<const PassPlan> plan, bool (*matches)(const PassInfo& pass));

/// Whether a pass, or what is shown in place of light, traces rays, so that a scene for them is needed whoever makes
/// the keys.
[[nodiscard]] bool traces_rays_beside_keys(const Requirements& scene, const RaySettings& settings);

/// Whether a pass that runs sends rays from lifted origins.
[[nodiscard]] bool lifts_origins(std::span<const PassPlan> plan, const RaySettings& settings);

/// Whether indirect light comes along rays (PassId::Gather) in place of photons: where the settings name the pass, and
/// where they prefer rays, allow photons and want all indirect light, and a constant environment is all the light there
/// is.
[[nodiscard]] bool gathers_by_rays(const Requirements& scene, const RaySettings& settings);

/// Whether both bring it: rays to what the eye sees, and photons to what those rays reach (RaySettings::final_gather).
[[nodiscard]] bool final_gathers(const Requirements& scene, const RaySettings& settings);

}  // namespace hpr
