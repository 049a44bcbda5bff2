#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "walls/config/wall.h"
#include "walls/manifest/manifest_file.h"

namespace hpr {

/// What a run measured of each screen of a wall, to colour a plan by.
struct WallHeat {
  std::string title;  ///< what the colours mean: "median time to hand a picture over, 100 frames"
  std::vector<std::optional<double>> values;    ///< per screen, never negative; none: not measured
  std::string unit;                             ///< " ms", " %"
  std::vector<std::vector<std::string>> notes;  ///< per screen: lines on all that was measured

  [[nodiscard]] double largest() const;
};

/// What a plan can be coloured by: "ms" (the median) and "bytes" (the mean) of handing over a screen's picture; and
/// the share of the frames in which it was "stale" or "lost".
[[nodiscard]] const std::vector<std::string>& heat_names();

/// Throws Error: BadInput where the manifest is of another wall or has nothing of the kind, Usage for an unknown name.
/// `path` of the manifest stands in errors.
[[nodiscard]] WallHeat wall_heat(const Wall& wall, const ManifestFile& manifest, const std::string& path,
                                 std::string_view by);

}  // namespace hpr
