#pragma once

#include <glm/vec2.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "image/image.h"

namespace hpr {

/// A wall of equal panels, described by a few numbers.
struct WallTemplate {
  int columns = 1;
  int rows = 1;
  std::vector<std::string> hosts =
      {};  ///< in the order of their screens, row by row from the top left; empty: this machine
  std::optional<int> tiles_per_host = {};      ///< none: shared out evenly
  int ranks_per_host = 1;                      ///< render processes
  std::optional<Size> tile_pixels = {};        ///< none: 1920 x 1080, on this machine 640 x 360
  std::optional<glm::dvec2> tile_size_m = {};  ///< lit; none: of a 46 inch panel, on this machine 0.36 m high
  std::optional<glm::dvec2> gap_m = {};        ///< lit edge to lit edge; none: 5.5 mm, on this machine 6 mm
  std::string command = {};                    ///< that made it, for the first comment; may be empty
};

/// The wall file of it, as TOML with comments that say what to measure and to change. Throws Error (Usage) where
/// screens and hosts do not fit together or a number is impossible.
[[nodiscard]] std::string write_wall_template(const WallTemplate& wall);

/// The hosts of a list as Slurm writes them, in its order: "wall0[1-9]", "a[01-03,07],b2", "rack[1-2]n[0-3]" (the last
/// bracket counts fastest). Numbers are as wide as the range's first one, so that [08-10] is 08, 09, 10. Throws Error
/// (Usage) for what is no such list, names a host twice, or has more than kMaxScreens hosts.
[[nodiscard]] std::vector<std::string> parse_host_list(std::string_view text);

}  // namespace hpr
