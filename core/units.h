#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace hpr {

/// "512", "64KiB", "1.5GB", "2G" in bytes (K, M, G, T are binary with or without "i", decimal with a plain "B" suffix).
[[nodiscard]] std::optional<std::uint64_t> parse_bytes(std::string_view text);

/// "512 B", "288 KiB", "1.5 GiB": in the largest binary unit of which it is one or more, rounded to a tenth.
[[nodiscard]] std::string format_bytes(std::uint64_t bytes);

/// "2us", "33ms", "1.5s", "2min"; a bare number is seconds.
[[nodiscard]] std::optional<std::chrono::nanoseconds> parse_duration(std::string_view text);

/// "1920x1080": two positive integers.
[[nodiscard]] std::optional<std::pair<int, int>> parse_extent(std::string_view text);

}  // namespace hpr
