#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/json.h"
#include "scene/gltf/context.h"
#include "scene/gltf/scan.h"

namespace hpr {

/// The bytes behind a document's buffers and pictures. Reads files only below the scene's folder.
class GltfBuffers {
 public:
  /// `parts` must outlive this.
  GltfBuffers(std::filesystem::path folder, const GltfParts& parts) : folder_(std::move(folder)), parts_(&parts) {}

  /// Loads every buffer of a document whose shape was checked; each then has exactly its byteLength. Throws Error.
  void load(const Json& root, GltfContext& context);

  [[nodiscard]] std::size_t size() const { return bytes_.size(); }
  [[nodiscard]] std::span<const std::byte> operator[](std::size_t buffer) const { return bytes_[buffer]; }

  /// What a "uri" member holds: a data URI's bytes or a file's. Throws Error (Io, BadInput, Limit).
  [[nodiscard]] std::vector<std::byte> resolve(const std::string& uri, const std::string& where,
                                               GltfContext& context) const;

 private:
  std::filesystem::path folder_;
  const GltfParts* parts_;
  std::vector<std::vector<std::byte>> owned_;
  std::vector<std::span<const std::byte>> bytes_;
};

}  // namespace hpr
