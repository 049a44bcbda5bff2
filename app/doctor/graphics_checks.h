#pragma once

#include <vector>

#include "app/doctor/doctor.h"

namespace hpr {

/// One check per GL backend of this build: does a context come up, and on what? Red only when none does.
[[nodiscard]] std::vector<Check> graphics_checks();

}  // namespace hpr
