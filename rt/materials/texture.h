#pragma once

#include <glm/vec2.hpp>
#include <glm/vec4.hpp>

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

}  // namespace hpr
