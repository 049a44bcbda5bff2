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

}  // namespace hpr
