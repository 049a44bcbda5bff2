#pragma once

#include <span>
#include <vector>

#include "scene/view.h"

namespace hpr {

/// The same screens, seen the same way, on round(`scale` times) their pixels, at least one a side: what a frame is made
/// at that is shown larger.
[[nodiscard]] std::vector<View> at_resolution(std::span<const View> screens, double scale);

}  // namespace hpr
