#pragma once

#include "core/json.h"
#include "scene/gltf/context.h"

namespace hpr {

/// Checks the shape of a glTF document before the model is built from it: the types of all members HPR reads, required
/// ones, and that every index points into its section. Values of materials and lights outside of what the
/// specification allows are brought inside, with a warning. What depends on several members (ranges of bytes, the
/// node hierarchy) is checked on the model, see accessors.h, mesh.h and loader.cpp. Throws Error (BadInput).
void check_shape(Json& root, GltfContext& context);

/// Refuses documents that require extensions HPR does not have, by name, and warns once of each one it ignores.
void check_extensions(Json& root, GltfContext& context);

}  // namespace hpr
