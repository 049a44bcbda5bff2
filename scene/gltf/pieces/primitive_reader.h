#pragma once

#include <memory>
#include <string>

#include "scene/gltf/accessors.h"
#include "scene/gltf/mesh.h"
#include "scene/mesh_reader.h"

namespace hpr {

/// Smaller meshes are read whole.
inline constexpr std::uint64_t kMinPieceBytes = std::uint64_t{4} << 20U;

/// Reads a primitive from where its file is, with what build_primitive() would give, whose arguments these are; `data`
/// and `primitive` must outlive it. At most 16 MiB of a mapped file are in memory at a time.
///
/// Null where pieces are not possible or not worth it: meshes below kMinPieceBytes, strips, fans, points, lines,
/// accessors that are sparse or have no bytes, morphed and skinned ones, and all that has errors or warnings: what is
/// wrong with it is said when it is read whole. All of it is looked at here once. What is wrong later, as the file
/// changed, is an Error (BadInput).
[[nodiscard]] std::unique_ptr<MeshReader> read_primitive_in_pieces(const GltfData& data,
                                                                   const tinygltf::Primitive& primitive,
                                                                   const GltfPose& pose);

}  // namespace hpr
