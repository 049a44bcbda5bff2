#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

namespace hpr {

/// XXH64 of `bytes` with seed 0: what manifests, reports and content comparisons use.
[[nodiscard]] std::uint64_t xxh64(std::span<const std::byte> bytes);

/// 16 lower-case hex digits.
[[nodiscard]] std::string hex16(std::uint64_t hash);

/// XXH64 of content that comes in parts.
class ContentHash {
 public:
  ContentHash();
  void add(std::span<const std::byte> bytes);
  [[nodiscard]] std::uint64_t value() const;

 private:
  struct Free {
    void operator()(void* state) const;
  };
  std::unique_ptr<void, Free> state_;
};

}  // namespace hpr
