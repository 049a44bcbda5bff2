#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "image/image.h"

/// How values of `hpr compare`'s options are written. What is written otherwise throws Error (Usage).
namespace hpr {

/// A list of strategies; numbers in it belong to the strategy before them: "tree,radix-k:4,2,ring".
[[nodiscard]] std::vector<std::string> split_strategies(std::string_view list);

/// "3x2"; throws Error (Limit) past `most` a side.
[[nodiscard]] Size parse_size(const std::string& text, const std::string& option, int most);

/// "1,2,4,8".
[[nodiscard]] std::vector<int> parse_ranks(const std::string& list);

}  // namespace hpr
