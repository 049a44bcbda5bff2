#pragma once

#include <string>

namespace hpr {

/// What a wall file may hold as a JSON Schema (draft 2020-12), for editors and other programs: every key, its type and
/// range. What spans tables (names that must exist, screens that must not overlap) only reading a file tells.
[[nodiscard]] std::string wall_schema();

}  // namespace hpr
