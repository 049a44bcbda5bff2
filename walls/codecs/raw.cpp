#include <cstring>

#include "walls/codecs/coder.h"

namespace hpr {
namespace {

/// The pixels as they are.
class RawCoder final : public Coder {
 public:
  explicit RawCoder(const CodecSettings& /*settings*/) {}

  [[nodiscard]] std::string_view name() const override { return "raw"; }

  void encode(const Image<Rgba8>& picture, std::vector<std::byte>& into, Image<Rgba8>* seen) override {
    const auto bytes = std::as_bytes(picture.pixels());
    into.insert(into.end(), bytes.begin(), bytes.end());
    if (seen != nullptr) *seen = picture;
  }

  void decode(std::span<const std::byte> bytes, int /*error*/, Image<Rgba8>& picture) override {
    const auto pixels = std::as_writable_bytes(picture.pixels());
    if (bytes.size() != pixels.size()) throw_damaged("it holds more or fewer pixels than it says");
    std::memcpy(pixels.data(), bytes.data(), bytes.size());
  }
};

}  // namespace

CoderKind raw_coder() {
  return {"raw", make_coder<RawCoder>};
}

}  // namespace hpr
