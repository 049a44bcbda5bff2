#pragma once

#include <string>

namespace hpr {

/// As this machine calls itself.
[[nodiscard]] std::string host_name();

}  // namespace hpr
