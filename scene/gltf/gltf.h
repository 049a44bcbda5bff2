#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "scene/load_scene.h"
#include "scene/scene.h"

namespace hpr {

/// A glTF 2.0 file (text or binary, known by its first bytes). Trusts nothing in it: every index, range, stride and
/// count is checked in 64 bits, URIs may only name files below the file's own folder, JSON deeper than 64 levels is
/// refused. What is wrong but harmless becomes a warning in Scene::warnings, as does what is wrong with things that the
/// chosen scene does not use. Points and lines have no shapes yet, see shape_points_and_lines. Throws Error (Io,
/// BadInput, Limit; Usage for a scene or variant that the file lacks).
///
/// `in_parts`: files stay where they are, and one mesh at a time is read, a large one in pieces
/// (read_primitive_in_pieces); those that not all ranks hold (is_held_by_all) come without triangles, see
/// LoadedScene::read_mesh. What is compressed (Draco, meshopt) is decoded whole.
[[nodiscard]] LoadedScene load_gltf(const std::filesystem::path& path, const SceneLimits& limits,
                                    const SceneChoice& choice = {}, bool in_parts = false);

/// The scene as a binary glTF 2.0 file: meshes, materials, textures (PNG), instances, punctual lights, cameras. Loading
/// it again gives the same triangles, points and lines, bit by bit. The background and headlights have no place in glTF
/// and are left out.
[[nodiscard]] std::vector<std::byte> encode_glb(const Scene& scene);

}  // namespace hpr
