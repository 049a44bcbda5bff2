#pragma once

#include "tools/compare/compare.h"

namespace hpr {

/// What compare_strategies does for `over`.
[[nodiscard]] CompareResult compare_blenders(Communicator& comm, const CompareInput& input,
                                             const CompareSettings& settings);

}  // namespace hpr
