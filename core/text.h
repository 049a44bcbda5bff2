#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

/// Text that people write and read: names, numbers with units, what is safe to print.
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

/// The words of a line: separated by blanks, "quoted" where they hold some; what follows # is a comment. None where a
/// quote is not closed.
[[nodiscard]] std::optional<std::vector<std::string>> split_line(const std::string& line);

/// "512", "64KiB", "1.5GB", "2G" in bytes (K, M, G, T are binary with or without "i", decimal with a plain "B" suffix).
[[nodiscard]] std::optional<std::uint64_t> parse_bytes(std::string_view text);

/// "512 B", "288 KiB", "1.5 GiB": in the largest binary unit of which it is one or more, rounded to a tenth.
[[nodiscard]] std::string format_bytes(std::uint64_t bytes);

/// "2us", "33ms", "1.5s", "2min"; a bare number is seconds.
[[nodiscard]] std::optional<std::chrono::nanoseconds> parse_duration(std::string_view text);

/// "1920x1080": two positive integers.
[[nodiscard]] std::optional<std::pair<int, int>> parse_extent(std::string_view text);

/// One word of a POSIX shell that stands for `text`, in single quotes.
[[nodiscard]] std::string shell_quote(std::string_view text);

/// A command line of these words; quoted are those that a shell would not take as they are.
[[nodiscard]] std::string shell_line(std::span<const std::string> words);

}  // namespace hpr
