#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "walls/codecs/codec.h"

namespace hpr {

/// How the pixels of one picture become bytes; without memory of other pictures.
class Coder {
 public:
  virtual ~Coder() = default;

  [[nodiscard]] virtual std::string_view name() const = 0;

  /// Appends the bytes of `picture`, which is not empty, to `into`. Where `seen` is given it becomes what decode()
  /// will return.
  virtual void encode(const Image<Rgba8>& picture, std::vector<std::byte>& into, Image<Rgba8>* seen) = 0;

  /// Throws Error (BadInput); `picture` has the size that was encoded. `error` is that of the encoder's settings.
  virtual void decode(std::span<const std::byte> bytes, int error, Image<Rgba8>& picture) = 0;
};

/// How to make a coder; defined in the file of its name.
struct CoderKind {
  std::string_view name;  ///< of the codec that sends what it encodes
  std::unique_ptr<Coder> (*make)(const CodecSettings& settings);
  bool lossy = false;  ///< even where no error is allowed
};

/// Every coder, in the order in which they trade speed for size: X(raw) stands for raw.cpp, which defines raw_coder().
/// A coder's place in the list is its number in messages.
#define HPR_CODERS(X) \
  X(raw)              \
  X(lz4)              \
  X(zstd)             \
  X(jpeg)

#define HPR_DECLARE_CODER(name) [[nodiscard]] CoderKind name##_coder();
HPR_CODERS(HPR_DECLARE_CODER)
#undef HPR_DECLARE_CODER

[[nodiscard]] std::span<const CoderKind> all_coders();

template <typename Implementation>
[[nodiscard]] std::unique_ptr<Coder> make_coder(const CodecSettings& settings) {
  return std::make_unique<Implementation>(settings);
}

/// "the picture's bytes are damaged: WHAT", BadInput.
[[noreturn]] void throw_damaged(std::string_view what);

/// A cheap reversible filter before general compressors: pixels become four planes, r - g, g, b - g and a, each byte
/// less the one before it (all modulo 256). On a rendered frame zstd takes a third less for it than for plain pixels.
/// `planes` has four bytes a pixel.
void split_planes(std::span<const Rgba8> pixels, std::span<std::uint8_t> planes);
void join_planes(std::span<const std::uint8_t> planes, std::span<Rgba8> pixels);

/// Every r, g and b as the number of the step of 2 error + 1 it is nearest to, and back: within `error` of what it was.
/// Alpha stays. `steps` and `pixels` may be the same.
void quantize(std::span<const Rgba8> pixels, int error, std::span<Rgba8> steps);
void dequantize(std::span<const Rgba8> steps, int error, std::span<Rgba8> pixels);

/// No r, g or b differs by more than `error`, and no alpha at all. Equal counts.
[[nodiscard]] bool all_within(std::span<const Rgba8> a, std::span<const Rgba8> b, int error);

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
