#pragma once

#include <nlohmann/json.hpp>

#include "walls/manifest/manifest.h"

namespace hpr {

/// As manifests and --stats tell it.
[[nodiscard]] inline nlohmann::ordered_json budget_json(const BudgetRecord& budget) {
  return {{"target_ms", budget.target_ms},
          {"resolution_scale", budget.resolution_scale},
          {"samples", budget.samples},
          {"given_up", budget.given_up},
          {"resting", budget.resting}};
}

}  // namespace hpr
