#pragma once

#include <array>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

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

/// A material where a surface was met: its textures read, its normal map applied.
struct MaterialPoint {
  glm::dvec3 base_color{1.0};
  double metallic = 0.0;
  double roughness = 1.0;
  double transmission = 0.0;   ///< share of the dielectric's diffuse light that is let through instead
  double ior = 1.5;            ///< 0: reflects everything
  glm::dvec3 emission{0.0};    ///< radiance
  double alpha = 1.0;          ///< coverage: 1 for OPAQUE; 0 or 1 for MASK
  double occlusion = 1.0;      ///< of ambient light only
  bool unlit = false;          ///< shows `emission`, which then is the base colour, and scatters nothing
  bool solid = false;          ///< bounds a volume: light that passes is refracted; else a thin sheet, which it crosses
  glm::dvec3 absorption{0.0};  ///< 1/m inside the volume: Beer's law; finite
  glm::dvec3 normal{0.0, 0.0, 1.0};  ///< unit length, to shade with: on the viewer's side
};

/// The material with its textures read at the surface's coordinates, vertex colours and normal map applied.
[[nodiscard]] MaterialPoint evaluate_material(const Scene& scene, const SurfacePoint& surface);

/// Asks the memory for the texels evaluate_material will read there.
void prefetch_material(const Scene& scene, const SurfacePoint& surface);

/// MaterialPoint::normal alone: as the viewer at surface.to_viewer has it.
[[nodiscard]] glm::dvec3 normal_to_shade_with(const Scene& scene, const SurfacePoint& surface);

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
