#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <utility>
#include <vector>

namespace hpr {

/// The bytes of a file: read into memory, or left where they are and read as they are looked at. Of a mapped file that
/// another process cuts off meanwhile, reading what is gone ends this one.
class FileBytes {
 public:
  FileBytes() = default;
  // NOLINTNEXTLINE(google-explicit-constructor): bytes are what they are
  FileBytes(std::vector<std::byte> read) : read_(std::move(read)) {}
  FileBytes(FileBytes&& other) noexcept : read_(std::move(other.read_)), mapped_(std::exchange(other.mapped_, {})) {}
  FileBytes& operator=(FileBytes&& other) noexcept;
  FileBytes(const FileBytes&) = delete;
  FileBytes& operator=(const FileBytes&) = delete;
  ~FileBytes();

  /// Maps `size` bytes of an open regular file. Throws Error (Limit) where there are no addresses for them.
  [[nodiscard]] static FileBytes mapped(int descriptor, std::uint64_t size);

  [[nodiscard]] std::span<const std::byte> bytes() const { return mapped_.empty() ? std::span(read_) : mapped_; }
  /// Gives back the memory of what was looked at of a mapped file; it is read again where it is looked at again.
  void forget() const;

 private:
  std::vector<std::byte> read_;
  std::span<const std::byte> mapped_;
};

/// A regular file, mapped. Throws Error as read_file does.
[[nodiscard]] FileBytes map_file(const std::filesystem::path& path, std::uint64_t limit_bytes);

}  // namespace hpr
