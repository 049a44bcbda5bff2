#pragma once

#include <string>

namespace hpr::test {

/// The path of a file of walls/examples. Defined in a source of its own: a path of this machine inside a test's source
/// would have every clone compile that test again.
[[nodiscard]] std::string example_wall(const std::string& name);

}  // namespace hpr::test
