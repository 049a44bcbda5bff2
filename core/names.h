#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace hpr {

/// The choice that differs from `name` by the fewest insertions, deletions, substitutions and swaps of neighbours
/// (Damerau 1964); none when even the best differs in more than a third of the letters of `name`, rounded up.
[[nodiscard]] std::optional<std::string> nearest_name(std::string_view name, std::span<const std::string> choices);

/// "did you mean 'tree'? choices: serial, tree": the hint for an unknown name.
[[nodiscard]] std::string unknown_name_hint(std::string_view name, std::span<const std::string> choices);

/// `text` with control characters, invisible and direction-changing ones, and bytes that are no UTF-8 written as \xNN;
/// at most `limit` bytes and then "...": for names that come out of files and reach a terminal.
[[nodiscard]] std::string printable(std::string_view text, std::size_t limit = 80);

/// The words between commas.
[[nodiscard]] std::vector<std::string> split_commas(std::string_view list);
/// The words between commas that are not empty.
[[nodiscard]] std::vector<std::string> split_words(std::string_view list);

}  // namespace hpr
