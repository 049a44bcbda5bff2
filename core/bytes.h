#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "core/error.h"

/// Bytes: a buffer of them, their hash, and the text they are written as.
namespace hpr {

/// Bytes that grow at their end and are meant to be used again and again: clearing keeps the memory, and new bytes are
/// not set to zero. A std::vector would write every byte of a message twice and, past the allocator's limit for large
/// blocks, have the system hand out fresh pages for each one.
class ByteBuffer {
 public:
  [[nodiscard]] std::span<const std::byte> bytes() const { return {memory_.get(), size_}; }
  [[nodiscard]] std::span<std::byte> bytes() { return {memory_.get(), size_}; }
  [[nodiscard]] std::size_t size() const { return size_; }

  void clear() { size_ = 0; }

  /// `count` more bytes at the end, unset. Spans handed out before are void when the memory had to grow.
  std::span<std::byte> extend(std::size_t count) {
    if (size_ + count > capacity_) reserve(std::max(size_ + count, capacity_ + capacity_ / 2));
    const std::span<std::byte> added(memory_.get() + size_, count);
    size_ += count;
    return added;
  }

  void append(std::span<const std::byte> more) {
    if (!more.empty()) std::memcpy(extend(more.size()).data(), more.data(), more.size());
  }

  /// Gives back bytes of the end.
  void shrink(std::size_t size) {
    HPR_CHECK(size <= size_);
    size_ = size;
  }

  void reserve(std::size_t capacity) {
    if (capacity <= capacity_) return;
    auto grown = std::make_unique_for_overwrite<std::byte[]>(capacity);
    if (size_ > 0) std::memcpy(grown.get(), memory_.get(), size_);
    memory_ = std::move(grown);
    capacity_ = capacity;
  }

 private:
  std::unique_ptr<std::byte[]> memory_;
  std::size_t size_ = 0;
  std::size_t capacity_ = 0;
};

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

/// RFC 4648, section 4, with padding.
[[nodiscard]] std::string base64(std::span<const std::byte> bytes);

/// Fills `bytes` from the system's source of random numbers. Throws Error (Io).
void fill_random(std::span<std::byte> bytes);

/// 32 hexadecimal digits. Throws Error (Io).
[[nodiscard]] std::string random_token();

/// Whether `candidate` equals `token`, compared in a time that does not depend on where they differ.
[[nodiscard]] bool same_token(std::string_view candidate, std::string_view token);

}  // namespace hpr
