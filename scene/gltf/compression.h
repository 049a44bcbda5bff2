#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/json.h"
#include "scene/gltf/accessors.h"
#include "scene/gltf/document.h"

namespace hpr {

/// Decodes what a document holds compressed and rewrites it as if it had never been, so that whatever follows knows
/// nothing of it. The shape of the document was checked, its buffers were loaded. What is decoded is charged to the
/// memory limit before it is allocated. Throws Error: BadInput for data that cannot be decoded or that differ from
/// what the document says of them, Limit.
///
/// EXT_meshopt_compression, every mode and filter: each compressed view becomes a view of a buffer of its own.
void decode_meshopt_views(Json& root, GltfBuffers& buffers, GltfContext& context);

/// KHR_draco_mesh_compression: each attribute and the triangles of a compressed primitive become accessors with bytes.
/// Views are decoded by decode_meshopt_views before.
void decode_draco_primitives(Json& root, GltfBuffers& buffers, GltfContext& context);

}  // namespace hpr
