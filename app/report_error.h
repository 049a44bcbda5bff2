#pragma once

#include <string_view>

#include "core/error.h"

namespace hpr {

/// Prints an error on stderr in at most three lines: what and where, the offending line where there is one, a hint.
void print_error(const Error& error, std::string_view who = "");

}  // namespace hpr
