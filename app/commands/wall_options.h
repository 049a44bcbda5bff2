#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/options/option_set.h"

/// Options that several commands of walls have.
namespace hpr {

/// The wall itself, a required positional.
void declare_wall(const OptionSet& options, std::string& wall);

/// `--set PATH=VALUE`, as often as wanted.
void declare_overrides(const OptionSet& options, std::vector<std::string>& overrides);

/// `--target-ms`: milliseconds, or another unit that is named.
void declare_target_ms(const OptionSet& options, std::optional<double>& target_ms, const std::string& text);

}  // namespace hpr
