#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

namespace hpr {

class Pass;

/// The ray passes, in the order in which they run and in which reports list them.
enum class PassId : std::uint8_t { Shadow, Reflection, Refraction, AmbientOcclusion, Photon, Gather };
inline constexpr std::size_t kPasses = static_cast<std::size_t>(PassId::Gather) + 1;

// Makers of passes, each in the pass's own file.
[[nodiscard]] std::unique_ptr<Pass> make_shadow_pass();
[[nodiscard]] std::unique_ptr<Pass> make_reflection_pass();
[[nodiscard]] std::unique_ptr<Pass> make_refraction_pass();
[[nodiscard]] std::unique_ptr<Pass> make_ambient_occlusion_pass();
[[nodiscard]] std::unique_ptr<Pass> make_photon_pass();
[[nodiscard]] std::unique_ptr<Pass> make_gather_pass();

/// Parts of a pixel's color; they sum to it. Apart from Direct each one belongs to a pass.
enum class Component : std::uint8_t {
  Direct,            ///< emission, and light as if nothing stood in its way
  Shadow,            ///< what of that is blocked: never above 0
  Reflection,        ///< all that arrives by the first surface's specular reflection
  Refraction,        ///< all that arrives through the first surface
  AmbientOcclusion,  ///< of the first surface
  Photon,            ///< of the first surface: indirect light, by photons or by rays that gather it
};
inline constexpr std::size_t kComponents = static_cast<std::size_t>(Component::Photon) + 1;

/// Whether a pass runs for a scene, for --explain and --stats.
struct PassPlan {
  PassId pass = PassId::Shadow;
  bool runs = false;
  std::string why;
};

}  // namespace hpr
