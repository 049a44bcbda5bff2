#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

/// What nobody else can guess.
namespace hpr {

/// From the system's source of random numbers. Throws Error (Io).
void fill_random(std::span<std::byte> bytes);

/// 32 hexadecimal digits. Throws Error (Io).
[[nodiscard]] std::string random_token();

/// In a time that does not tell how much of it is right.
[[nodiscard]] bool same_token(std::string_view given, std::string_view token);

}  // namespace hpr
