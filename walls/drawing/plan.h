#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "walls/config/wall.h"
#include "walls/manifest/manifest.h"

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
/// the fraction of the frames in which it was "stale" or "lost".
[[nodiscard]] const std::vector<std::string>& heat_names();

/// Throws Error: BadInput where the manifest is of another wall or has nothing of the kind, Usage for an unknown name.
/// `path` of the manifest stands in errors.
[[nodiscard]] WallHeat wall_heat(const Wall& wall, const ManifestFile& manifest, const std::string& path,
                                 std::string_view by);

/// The plan of a wall, for people: its screens as they stand, to scale, with their ids, sizes in pixels and
/// millimetres and owners (host, rank, window), gaps hatched, and the wall from above with its viewer. With `heat`
/// screens are coloured by what a run measured of them instead of by their owners, and a scale shows the values. SVG
/// and pixels come from one drawing code.
[[nodiscard]] std::string wall_plan_svg(const Wall& wall, const WallHeat* heat = nullptr);
[[nodiscard]] Image<Rgba8> wall_plan_image(const Wall& wall, const WallHeat* heat = nullptr);

/// "pc (localhost), rank 0", "rank 2", or "any rank".
[[nodiscard]] std::string owner_of(const Wall& wall, const WallScreen& screen);

}  // namespace hpr
