#include <fmt/format.h>
#include <lz4.h>

#include <cstring>

#include "core/error.h"
#include "walls/codecs/coder.h"

namespace hpr {
namespace {

/// Filtered planes, each one LZ4 block behind its length.
class Lz4Coder final : public Coder {
 public:
  explicit Lz4Coder(const CodecSettings& settings) : error_(settings.error) {}

  [[nodiscard]] std::string_view name() const override { return "lz4"; }

  void encode(const Image<Rgba8>& picture, std::vector<std::byte>& into, Image<Rgba8>* seen) override {
    const std::size_t count = picture.pixels().size();
    if (count > LZ4_MAX_INPUT_SIZE) {
      throw Error(ExitCode::Limit, fmt::format("lz4 cannot take a picture of {} pixels", count), "use zstd");
    }
    planes_.resize(4 * count);
    if (error_ == 0) {
      split_planes(picture.pixels(), planes_);
    } else {
      steps_.resize(count);
      quantize(picture.pixels(), error_, steps_);
      split_planes(steps_, planes_);
    }
    for (std::size_t plane = 0; plane < 4; ++plane)
      append_block(std::span(planes_).subspan(plane * count, count), into);
    if (seen == nullptr) return;
    *seen = picture;
    if (error_ > 0) dequantize(steps_, error_, seen->pixels());
  }

  void decode(std::span<const std::byte> bytes, int error, Image<Rgba8>& picture) override {
    const std::size_t count = picture.pixels().size();
    planes_.resize(4 * count);
    for (std::size_t plane = 0; plane < 4; ++plane) {
      read_block(bytes, std::span(planes_).subspan(plane * count, count));
    }
    if (!bytes.empty()) throw_damaged("bytes follow its last plane");
    join_planes(planes_, picture.pixels());
    if (error > 0) dequantize(picture.pixels(), error, picture.pixels());
  }

 private:
  using Length = std::uint32_t;

  static void append_block(std::span<const std::uint8_t> plane, std::vector<std::byte>& into) {
    const int bound = LZ4_compressBound(static_cast<int>(plane.size()));
    const std::size_t start = into.size() + sizeof(Length);
    into.resize(start + static_cast<std::size_t>(bound));
    const int written =
        LZ4_compress_default(reinterpret_cast<const char*>(plane.data()), reinterpret_cast<char*>(into.data() + start),
                             static_cast<int>(plane.size()), bound);
    const auto length = static_cast<Length>(written);
    std::memcpy(into.data() + start - sizeof(Length), &length, sizeof(Length));
    into.resize(start + length);
  }

  static void read_block(std::span<const std::byte>& bytes, std::span<std::uint8_t> plane) {
    Length length = 0;
    if (bytes.size() < sizeof(Length)) throw_damaged("a plane is missing");
    std::memcpy(&length, bytes.data(), sizeof(Length));
    bytes = bytes.subspan(sizeof(Length));
    if (length > bytes.size() || length > LZ4_MAX_INPUT_SIZE || plane.size() > LZ4_MAX_INPUT_SIZE) {
      throw_damaged("a plane is cut short");
    }
    const int read =
        LZ4_decompress_safe(reinterpret_cast<const char*>(bytes.data()), reinterpret_cast<char*>(plane.data()),
                            static_cast<int>(length), static_cast<int>(plane.size()));
    if (read < 0 || static_cast<std::size_t>(read) != plane.size())
      throw_damaged("a plane is no LZ4 block of its size");
    bytes = bytes.subspan(length);
  }

  int error_;
  std::vector<std::uint8_t> planes_;
  std::vector<Rgba8> steps_;
};

}  // namespace

CoderKind lz4_coder() {
  return {"lz4", make_coder<Lz4Coder>};
}

}  // namespace hpr
