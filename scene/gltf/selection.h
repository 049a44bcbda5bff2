#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "core/json.h"
#include "scene/gltf/document.h"

namespace hpr {

/// The names of a document's scenes ("scene0", "scene1", ... where they have none) and, by KHR_materials_variants, of
/// its variants of materials. The document need not have been checked.
[[nodiscard]] std::vector<std::string> scene_names(const Json& document);
[[nodiscard]] std::vector<std::string> variant_names(const Json& document);

/// The scene to draw: the first of the name `wanted`, else the one at that index, where nothing is wanted the one that
/// the document names, else the first. Throws Error (Usage) with the choices for a scene there is not.
[[nodiscard]] std::size_t find_scene(const Json& document, const std::string& wanted, const GltfContext& context);

/// Gives every primitive that has a material for the variant `wanted` that material; where nothing is wanted, removes
/// what primitives say of variants. Throws Error (Usage) with the choices for a variant there is not.
void apply_variant(Json& document, const std::string& wanted, const GltfContext& context);

}  // namespace hpr
