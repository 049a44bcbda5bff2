#pragma once

#include <string>
#include <vector>

#include "walls/config/wall.h"

namespace hpr {

/// Per screen the rank that shows it: the one the wall file names, else one on the screen's host, else any: no more
/// ranks than the pixels keep busy, each with neighbouring screens. `hosts`: per rank. `remote`: displays outside the
/// job show them. Warns where the wall file cannot be followed.
[[nodiscard]] std::vector<int> owners_of(const Wall& wall, const std::vector<std::string>& hosts, bool remote);

}  // namespace hpr
