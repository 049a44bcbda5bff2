#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace hpr {

/// Zstandard with contexts that are used again, at its fastest level that codes by frequency.
class ZstdStream {
 public:
  ZstdStream();

  /// Appends one frame.
  void compress(std::span<const std::uint8_t> bytes, std::vector<std::byte>& into);

  /// Fills `into`, and takes no more memory for it whatever the frame asks. Throws Error (BadInput) unless
  /// `bytes` is one whole frame of just its size.
  void decompress(std::span<const std::byte> bytes, std::span<std::uint8_t> into);

 private:
  struct Free {
    void operator()(void* context) const;
  };
  std::unique_ptr<void, Free> compressor_;
  struct FreeDecompressor {
    void operator()(void* context) const;
  };
  std::unique_ptr<void, FreeDecompressor> decompressor_;
};

}  // namespace hpr
