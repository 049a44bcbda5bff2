#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "walls/config/wall.h"

namespace hpr {

/// A manifest as a run left it: what another run, or a drawing, needs of it.
struct ManifestFile {
  std::uint64_t scene_hash = 0;
  std::uint64_t wall_hash = 0;
  std::uint64_t seed = 0;
  std::vector<std::string> frames;    ///< records in order, one JSON object each, on one line
  std::vector<std::string> restarts;  ///< JSON objects
  std::optional<int> stopped_of;      ///< the frames the run was to have, where it was stopped before
};

/// Reads what to_json(RunManifest) writes; `name` stands in errors. Throws Error (BadInput) for anything else.
[[nodiscard]] ManifestFile parse_manifest(std::string_view text, const std::string& name);

/// Throws Error (BadInput) unless the frames are 0, 1, ... of these screens, in their order.
void check_records(const ManifestFile& file, std::span<const WallScreen> screens, const std::string& name);

/// The same of a file, up to 1 GiB. Throws Error (Io) too.
[[nodiscard]] ManifestFile load_manifest(const std::string& path);

}  // namespace hpr
