#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string_view>
#include <vector>

#include "core/file_bytes.h"
#include "scene/gltf/document.h"

namespace hpr {

/// The two parts of a glTF file; both point into it.
struct GltfParts {
  std::string_view json;
  std::span<const std::byte> binary;  ///< the BIN chunk of a .glb, with its padding
  bool has_binary = false;
};

/// JSON may nest this deep: glTF itself needs about ten levels, and recursive parsers overflow the stack at some
/// thousands.
inline constexpr int kGltfJsonDepth = 64;

/// Tells text from binary glTF by the first bytes, checks the container (magic, version, lengths, order and bounds of
/// chunks) and then the text. Bytes after the last chunk are warned of. Throws Error (BadInput).
[[nodiscard]] GltfParts scan_gltf(std::span<const std::byte> file, GltfContext& context);

/// A file's bytes and its parts, which may be parsed.
struct GltfFile {
  FileBytes bytes;
  GltfParts parts;
};
/// Reads and scans a file, within the context's limits; leaves it where it is if the context reads in parts. Throws
/// Error (Io, BadInput, Limit).
[[nodiscard]] GltfFile open_gltf(const std::filesystem::path& path, GltfContext& context);

/// What has to hold before a recursive parser may see the text: valid UTF-8, nesting up to kGltfJsonDepth. Keys that
/// stand twice in one object are warned of: readers disagree on which one counts (here: the last).
void scan_json(std::string_view json, GltfContext& context);

}  // namespace hpr
