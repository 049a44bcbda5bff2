#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace hpr {

/// The other end of a link is gone, or sent what it may not send: the link is closed and, by the one who made it, tried
/// again. Not an Error, as it ends no run.
class LinkError : public std::runtime_error {
 public:
  explicit LinkError(const std::string& what, int code = 0) : std::runtime_error(what), code_(code) {}

  /// The system's (errno), where it was the system that failed; else 0.
  [[nodiscard]] int code() const { return code_; }

 private:
  int code_;
};

/// Writes what ByteReader reads: little-endian, packed.
class ByteWriter {
 public:
  void u8(std::uint8_t value) { bytes_.push_back(std::byte{value}); }
  void u32(std::uint32_t value) { number(value, sizeof value); }
  void u64(std::uint64_t value) { number(value, sizeof value); }
  void real(double value) { u64(std::bit_cast<std::uint64_t>(value)); }
  void raw(std::span<const std::byte> bytes) { bytes_.insert(bytes_.end(), bytes.begin(), bytes.end()); }
  /// Its length and its bytes.
  void text(std::string_view text) {
    u32(static_cast<std::uint32_t>(text.size()));
    raw(std::as_bytes(std::span(text)));
  }
  [[nodiscard]] const std::vector<std::byte>& bytes() const { return bytes_; }
  [[nodiscard]] std::vector<std::byte> take() { return std::move(bytes_); }

 private:
  void number(std::uint64_t value, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) bytes_.push_back(static_cast<std::byte>(value >> (8 * i)));
  }

  std::vector<std::byte> bytes_;
};

/// Reads bytes that came from elsewhere: whatever would reach past their end throws LinkError.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> bytes) : bytes_(bytes) {}

  [[nodiscard]] std::uint8_t u8() { return static_cast<std::uint8_t>(number(1)); }
  [[nodiscard]] std::uint32_t u32() { return static_cast<std::uint32_t>(number(4)); }
  [[nodiscard]] std::uint64_t u64() { return number(8); }
  [[nodiscard]] double real() { return std::bit_cast<double>(u64()); }
  [[nodiscard]] std::span<const std::byte> raw(std::size_t count) {
    if (count > bytes_.size()) throw LinkError("a message ends too early");
    const auto taken = bytes_.first(count);
    bytes_ = bytes_.subspan(count);
    return taken;
  }
  /// At most `limit` bytes long.
  [[nodiscard]] std::string text(std::size_t limit) {
    const std::size_t size = u32();
    if (size > limit) throw LinkError("a text is too long");
    const auto bytes = raw(size);
    std::string text(size, '\0');
    if (size > 0) std::memcpy(text.data(), bytes.data(), size);
    return text;
  }
  [[nodiscard]] std::span<const std::byte> rest() const { return bytes_; }
  /// Throws LinkError when bytes are left.
  void finish() const {
    if (!bytes_.empty()) throw LinkError("a message goes on too long");
  }

 private:
  [[nodiscard]] std::uint64_t number(std::size_t count) {
    const auto bytes = raw(count);
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < count; ++i) value |= std::to_integer<std::uint64_t>(bytes[i]) << (8 * i);
    return value;
  }

  std::span<const std::byte> bytes_;
};

}  // namespace hpr
