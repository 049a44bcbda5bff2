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

[[nodiscard]] std::unique_ptr<Coder> make_raw_coder();
[[nodiscard]] std::unique_ptr<Coder> make_lz4_coder(const CodecSettings& settings);
[[nodiscard]] std::unique_ptr<Coder> make_zstd_coder(const CodecSettings& settings);
[[nodiscard]] std::unique_ptr<Coder> make_jpeg_coder(const CodecSettings& settings);

/// One place per coder; its index is its number on the wire.
struct CoderKind {
  std::string_view name;
  std::unique_ptr<Coder> (*make)(const CodecSettings& settings);
  bool lossy = false;  ///< even where no error is allowed
};
[[nodiscard]] std::span<const CoderKind> all_coders();

/// "the picture's bytes are damaged: WHAT", BadInput.
[[noreturn]] void throw_damaged(std::string_view what);

}  // namespace hpr
