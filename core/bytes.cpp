#include "core/bytes.h"

#include <fmt/format.h>
#include <sys/random.h>
#include <xxhash.h>

#include <array>
#include <cstdint>
#include <new>

#include "core/error.h"

namespace hpr {

std::uint64_t xxh64(std::span<const std::byte> bytes) {
  return XXH64(bytes.data(), bytes.size(), 0);
}

std::string hex16(std::uint64_t hash) {
  return fmt::format("{:016x}", hash);
}

ContentHash::ContentHash() : state_(XXH64_createState()) {
  if (state_ == nullptr) throw std::bad_alloc();
  XXH64_reset(static_cast<XXH64_state_t*>(state_.get()), 0);
}

void ContentHash::add(std::span<const std::byte> bytes) {
  XXH64_update(static_cast<XXH64_state_t*>(state_.get()), bytes.data(), bytes.size());
}

std::uint64_t ContentHash::value() const {
  return XXH64_digest(static_cast<const XXH64_state_t*>(state_.get()));
}

void ContentHash::Free::operator()(void* state) const {
  XXH64_freeState(static_cast<XXH64_state_t*>(state));
}

std::string base64(std::span<const std::byte> bytes) {
  constexpr const char* kAlphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      bits = bits << 8U | (i + k < bytes.size() ? std::to_integer<std::uint32_t>(bytes[i + k]) : 0U);
    }
    for (std::size_t k = 0; k < 4; ++k) text += k <= bytes.size() - i ? kAlphabet[(bits >> (18 - 6 * k)) & 63U] : '=';
  }
  return text;
}

void fill_random(std::span<std::byte> bytes) {
  if (::getrandom(bytes.data(), bytes.size(), 0) == static_cast<ssize_t>(bytes.size())) return;
  throw Error(ExitCode::Io, "the system gives no random numbers for a key");
}

std::string random_token() {
  std::array<std::uint64_t, 2> words{};
  fill_random(std::as_writable_bytes(std::span(words)));
  return hex16(words[0]) + hex16(words[1]);
}

bool same_token(std::string_view candidate, std::string_view token) {
  if (candidate.size() != token.size()) return false;
  unsigned difference = 0;
  for (std::size_t i = 0; i < token.size(); ++i) {
    const auto each = [](char c) { return static_cast<unsigned>(static_cast<unsigned char>(c)); };
    difference |= each(candidate[i]) ^ each(token[i]);
  }
  return difference == 0;
}

}  // namespace hpr
