#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "image/image.h"

/// How lists and sizes are written on the command line and in reports.
namespace hpr {

inline constexpr int kMaxScreensASide = 256;

/// "3x2"; throws Error: Usage for what is no size, Limit past `most` a side.
[[nodiscard]] Size parse_size(const std::string& text, const std::string& option, int most);

/// "1,2,4,8": numbers from 1 to the most ranks there may be. Throws Error (Usage).
[[nodiscard]] std::vector<int> parse_counts(const std::string& list, const std::string& option);

/// "3x2".
[[nodiscard]] std::string grid_name(Size grid);

/// "3x2@640x360": the wall shorthand of so many screens of that size.
[[nodiscard]] std::string wall_of(Size grid, Size screen);

/// A field as RFC 4180 has it: in quotes where it holds what separates fields.
[[nodiscard]] std::string csv_field(const std::string& text);

}  // namespace hpr
