#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "walls/config/toml_reader.h"
#include "walls/config/wall.h"

namespace hpr {

/// Limits of what a wall file may ask for.
inline constexpr int kMaxScreens = 4096;
inline constexpr int kMaxScreenSide = 65536;  ///< pixels

/// A wall as far as it could be read, and everything wrong or odd about it.
struct WallReading {
  Wall wall;  ///< complete when no finding is an error
  std::vector<WallFinding> findings;

  [[nodiscard]] bool ok() const;
};

/// Reads the text of a wall file; `name` stands in findings, and files the wall names are looked for beside it.
///
/// Each override is PATH=VALUE, a path of keys and places in arrays (from 0) between dots, e.g.
/// viewers.0.position_m=[0,1.6,0.5], and its value stands over that of the file. What is not there is made; the place
/// after an array's last appends. A value is TOML, or a bare word that stands for a string. Findings name the override
/// such a value came from; a path that leads nowhere is a finding. Throws Error (Usage) for what is no override.
[[nodiscard]] WallReading parse_wall(std::string_view text, const std::string& name,
                                     const std::vector<std::string>& overrides = {}, WallText kind = WallText::File);

/// "6x3", or "6x3@1920x1080": a grid of equal screens (640 x 360 pixels where the shorthand has none) on whichever
/// hosts there are, 0.36 m high, gaps of 6 mm, without a viewer. None when `spec` has another form. Throws Error for
/// impossible numbers: Usage where nothing would be left, Limit where there are too many.
[[nodiscard]] std::optional<Wall> wall_from_shorthand(std::string_view spec);

/// A shorthand or a TOML file, with all its findings. Throws Error: Io when the file cannot be read, Usage or Limit
/// for an impossible shorthand, Usage for malformed overrides.
[[nodiscard]] WallReading read_wall(const std::string& spec, const std::vector<std::string>& overrides = {});

/// The wall of a shorthand or a TOML file, for those who need a sound one: logs warnings (unless another process of the
/// run does), throws the first error (BadInput) with file:line:column, the offending line and a hint.
[[nodiscard]] Wall load_wall(const std::string& spec, const std::vector<std::string>& overrides = {},
                             bool logs_warnings = true);

}  // namespace hpr
