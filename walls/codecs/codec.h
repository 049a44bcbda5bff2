#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "image/color.h"
#include "image/image.h"

namespace hpr {

struct CodecSettings {
  int quality = 90;     ///< of jpeg, 1..100
  int error = 0;        ///< largest difference of r, g or b the receiver may see, 0..255; 0 with jpeg: no bound
  bool deltas = false;  ///< send only the tiles that changed since the stream's last picture
  double link_bytes_per_second = 125e6;  ///< what auto chooses for; the default is a gigabit network
  int cores = 1;                         ///< for auto: streams that are encoded, and decoded, at a time
};

/// Turns the pictures of one stream into bytes, or such bytes into pictures; one object per stream and direction, as
/// it may remember the last picture.
///
/// raw, lz4 and zstd return every bit, or with an error of e > 0 every r, g and b within e and alpha as it was. jpeg
/// drops alpha (the receiver sees 255) and is as good as its quality; with an error of e > 0 it keeps that bound too,
/// by corrections, and alpha. auto tries the others on the stream's first pictures and goes on with what brings
/// pictures over the link soonest (choose_codec); jpeg is among them where there is a bound to keep.
class Codec {
 public:
  virtual ~Codec() = default;

  /// The name used on the command line and in reports.
  [[nodiscard]] virtual std::string_view name() const = 0;

  /// What to send. A picture of another size starts the stream anew. Throws Error (Limit) for a picture beyond what
  /// the codec can take: 65500 pixels a side for jpeg.
  [[nodiscard]] virtual std::vector<std::byte> encode(const Image<Rgba8>& picture) = 0;

  /// Takes what any codec's encode() returned. `picture` has the size that was encoded, and keeps it. Throws Error
  /// (BadInput) for anything else, with no more memory taken than that size asks for: damaged or cut bytes, another
  /// size, or tiles that build on a picture this receiver has not seen last; restart the sender then. `picture` holds
  /// undefined pixels after an error.
  virtual void decode(std::span<const std::byte> bytes, Image<Rgba8>& picture) = 0;

  /// The next picture is encoded whole; pictures decoded so far are forgotten.
  virtual void restart() = 0;
};

/// In the order in which they trade speed for size.
[[nodiscard]] const std::vector<std::string>& all_codecs();

/// Throws Error (Usage) for an unknown name, with the choices, and for settings out of their range.
[[nodiscard]] std::unique_ptr<Codec> make_codec(std::string_view name, const CodecSettings& settings);

}  // namespace hpr
