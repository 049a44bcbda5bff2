#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "image/image.h"
#include "walls/config/wall.h"

namespace hpr {

/// What other systems' files leave open.
struct ImportSettings {
  Size pixels{1920, 1080};   ///< of a screen where the file has none
  double pitch_m = 0.00025;  ///< metres from pixel to pixel where the file counts in pixels only
};

struct ImportedWall {
  Wall wall;                         ///< its names, nodes, windows, screens and viewer
  std::vector<std::string> remarks;  ///< what was assumed, or could not be carried over
};

/// Reads one other system's wall files; defined in the file of its name.
struct WallImporter {
  std::string_view name;
  std::string_view alias;
  std::string_view summary;
  /// Throws Error (BadInput) with the file's line where it is known. `name` is the file's, for messages.
  ImportedWall (*read)(std::string_view text, const std::string& name, const ImportSettings& settings);
};
[[nodiscard]] std::span<const WallImporter> all_importers();
/// Names and aliases.
[[nodiscard]] const std::vector<std::string>& importer_names();

/// A wall file of ours from one of the system `kind` (a name or an alias): TOML that parse_wall takes, with the remarks
/// as comments. Throws Error: Usage for an unknown kind, with the choices; BadInput for what is wrong with the file.
[[nodiscard]] std::string import_wall(std::string_view text, const std::string& name, std::string_view kind,
                                      const ImportSettings& settings);

/// Every importer, in the order in which help lists them: X(tide) stands for tide.cpp, which defines tide_importer().
#define HPR_IMPORTERS(X) \
  X(paraview)            \
  X(tide)                \
  X(ospray)              \
  X(displaycluster)

#define HPR_DECLARE_IMPORTER(name) [[nodiscard]] WallImporter name##_importer();
HPR_IMPORTERS(HPR_DECLARE_IMPORTER)
#undef HPR_DECLARE_IMPORTER

}  // namespace hpr
