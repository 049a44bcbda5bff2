#pragma once

#include <span>
#include <string>
#include <string_view>

namespace hpr {

/// One word of a POSIX shell that stands for `text`, in single quotes.
[[nodiscard]] std::string shell_quote(std::string_view text);

/// A command line of these words; quoted are those that a shell would not take as they are.
[[nodiscard]] std::string shell_line(std::span<const std::string> words);

}  // namespace hpr
