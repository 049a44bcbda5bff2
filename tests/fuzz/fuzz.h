#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

/// What a fuzz target defines, one in each fuzz_*.cpp; fuzz_main.cpp drives it.
namespace hpr::fuzz {

using Bytes = std::vector<std::byte>;

[[nodiscard]] inline Bytes to_bytes(std::string_view text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

/// Good inputs of every kind, where mutations begin.
[[nodiscard]] std::vector<Bytes> seeds();

/// Reads the input as the program would; returns whether it is good. What is wrong with it may end in the errors the
/// program has for that, and in nothing else.
bool run(std::span<const std::byte> input);

/// `input` with checksums that are right again, where its format has some: behind them lies most of the code.
[[nodiscard]] Bytes repaired(Bytes input);

}  // namespace hpr::fuzz
