#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <memory>

#include "rt/trace/surfaces.h"
#include "scene/scene.h"

namespace hpr {

enum class Encoding { Linear, Srgb };

/// `texture` at `uv` (glTF: v grows downwards, texel centres at + 0.5), bilinear or nearest, wrapped as it says. Colour
/// channels are decoded before they are mixed; alpha never is. Any uv is safe: those that are not finite read as 0.
/// White where the image is empty.
[[nodiscard]] glm::dvec4 sample_texture(const Texture& texture, Encoding encoding, glm::dvec2 uv);

/// Asks the memory for the texels sample_texture will read.
void prefetch_texture(const Texture& texture, glm::dvec2 uv);

/// KHR_texture_transform.
[[nodiscard]] glm::dvec2 transformed_uv(const TextureRef& reference, const glm::vec2& uv);

/// MaterialExtensions where a surface was met.
struct ExtensionPoint {
  double specular = 1.0;
  glm::dvec3 specular_color{1.0};
  double clearcoat = 0.0;
  double clearcoat_roughness = 0.0;
  glm::dvec3 clearcoat_normal{0.0, 0.0, 1.0};  ///< unit length, on the viewer's side
  glm::dvec3 sheen_color{0.0};
  double sheen_roughness = 0.0;
  double anisotropy = 0.0;
  glm::dvec3 anisotropy_direction{0.0};  ///< world, in which it is rougher: not zero where `anisotropy` is not
  double iridescence = 0.0;
  double iridescence_ior = 1.3;
  double iridescence_nm = 0.0;        ///< thickness of the film
  double diffuse_transmission = 0.0;  ///< share of the diffuse light
  glm::dvec3 diffuse_transmission_color{1.0};
};

/// The part of Schlick's Fresnel term that rises from 0 straight on to 1 aslant.
[[nodiscard]] inline double schlick_rise(double cosine) {
  const double m = 1.0 - std::clamp(cosine, 0.0, 1.0);
  return (m * m) * (m * m) * m;
}

/// The share of light that a clear coat leaves to what lies below it, by Schlick's term at the coat's own normal.
[[nodiscard]] double coat_transmittance(const ExtensionPoint& extensions, const glm::dvec3& direction);

/// A material where a surface was met: its textures read, its normal map applied.
struct MaterialPoint {
  glm::dvec3 base_color{1.0};
  double metallic = 0.0;
  double roughness = 1.0;
  double transmission = 0.0;  ///< share of the dielectric's diffuse light that is let through instead
  double ior = 1.5;           ///< 0: reflects everything
  glm::dvec3 emission{0.0};   ///< radiance towards the viewer: a coat dims it
  double alpha = 1.0;         ///< coverage: 1 for OPAQUE; 0 or 1 for MASK
  double occlusion = 1.0;     ///< of ambient light only
  bool unlit = false;         ///< shows `emission`, which then is the base colour, and scatters nothing
  bool solid = false;         ///< bounds a volume: light that passes is refracted; else a thin sheet, which it crosses
  /// The only channel of light that goes through, bent by `ior`; kAllChannels where none was chosen.
  std::uint8_t channel = kAllChannels;
  float channel_scale = 1.0F;        ///< of that light: over the chance of the choice
  double ior_spread = 0.0;           ///< by which the index of blue is above that of green, and red's below
  glm::dvec3 absorption{0.0};        ///< 1/m inside the volume: Beer's law; finite
  glm::dvec3 normal{0.0, 0.0, 1.0};  ///< unit length, to shade with: on the viewer's side
  std::shared_ptr<const ExtensionPoint> extensions;  ///< null where none has an effect on what scatters

  static constexpr std::uint8_t kAllChannels = 3;
};

/// The material with its textures read at the surface's coordinates, vertex colours and normal map applied.
[[nodiscard]] MaterialPoint evaluate_material(const Scene& scene, const SurfacePoint& surface);

/// Whether the surface bends each channel of light otherwise, so that what goes through is to be of one.
[[nodiscard]] inline bool disperses(const MaterialPoint& material) {
  return material.ior_spread > 0.0 && material.channel == MaterialPoint::kAllChannels;
}

/// Whether light is of more than one channel.
[[nodiscard]] inline bool carries_channels(const glm::dvec3& light) {
  return (light.r > 0.0 ? 1 : 0) + (light.g > 0.0 ? 1 : 0) + (light.b > 0.0 ? 1 : 0) > 1;
}

/// Leaves the light of one channel to what goes through a surface that disperses, times `scale`.
void set_channel(MaterialPoint& material, int channel, double scale);

/// Chooses the channel of light that goes through a surface that disperses by what of `throughput` it carries, `u` in
/// [0, 1): light of one channel stays what it is, other light becomes up to 3 times as bright in one.
void choose_channel(MaterialPoint& material, const glm::dvec3& throughput, double u);

/// Asks the memory for the texels evaluate_material will read there.
void prefetch_material(const Scene& scene, const SurfacePoint& surface);

/// MaterialPoint::normal alone: as the viewer at surface.to_viewer has it.
[[nodiscard]] glm::dvec3 normal_to_shade_with(const Scene& scene, const SurfacePoint& surface);

/// ExtensionPoint::clearcoat_normal alone, likewise: by the coat's own map, not by the material's.
[[nodiscard]] glm::dvec3 coat_normal_to_shade_with(const Scene& scene, const SurfacePoint& surface);

/// 1/m, finite: KHR_materials_volume's, by which `attenuation_distance` metres leave the attenuation colour.
[[nodiscard]] glm::dvec3 absorption_of(const Material& material);

/// What of a surface with this alpha is there, as the material's mode has it.
[[nodiscard]] double coverage_of(const Material& material, double alpha);

/// Whether some material lets rays pass by its alpha.
[[nodiscard]] bool has_coverage(const Scene& scene);

/// Coverage alone, for rays that may pass: cheaper than evaluate_material. `uv` and `color_alpha` of the place.
[[nodiscard]] double evaluate_alpha(const Scene& scene, const Material& material, const std::array<glm::vec2, 2>& uv,
                                    double color_alpha);

}  // namespace hpr
