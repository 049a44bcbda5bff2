#include "core/secrets.h"

#include <sys/random.h>

#include <array>
#include <cstdint>

#include "core/error.h"
#include "core/hash.h"

namespace hpr {

void fill_random(std::span<std::byte> bytes) {
  if (::getrandom(bytes.data(), bytes.size(), 0) == static_cast<ssize_t>(bytes.size())) return;
  throw Error(ExitCode::Io, "the system gives no random numbers for a key");
}

std::string random_token() {
  std::array<std::uint64_t, 2> words{};
  fill_random(std::as_writable_bytes(std::span(words)));
  return hex16(words[0]) + hex16(words[1]);
}

bool same_token(std::string_view given, std::string_view token) {
  if (given.size() != token.size()) return false;
  unsigned difference = 0;
  for (std::size_t i = 0; i < token.size(); ++i) {
    const auto each = [](char c) { return static_cast<unsigned>(static_cast<unsigned char>(c)); };
    difference |= each(given[i]) ^ each(token[i]);
  }
  return difference == 0;
}

}  // namespace hpr
