#pragma once

#include <string>

namespace hpr {

/// As this machine calls itself.
[[nodiscard]] std::string host_name();

/// What stands before the words of a rank: "rank 3 on wall02: ", nothing for rank 0.
[[nodiscard]] std::string said_by(int rank);

}  // namespace hpr
