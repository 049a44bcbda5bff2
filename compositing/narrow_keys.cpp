#include "compositing/narrow_keys.h"

#include <bit>
#include <cstring>

namespace hpr {
namespace {

static_assert(std::endian::native == std::endian::little);

// Each key but the last goes as a whole word, of which the next one overwrites the highest bytes: sizes are known to
// the compiler, and no byte is handled by itself.

template <DepthFormat kFormat>
void narrow(std::span<const Key> keys, std::byte* bytes) {
  if (keys.empty()) return;
  for (const Key key : keys.first(keys.size() - 1)) {
    const std::uint64_t word = narrow_key(key, kFormat);
    std::memcpy(bytes, &word, sizeof word);
    bytes += sent_bytes(kFormat);
  }
  const std::uint64_t last = narrow_key(keys.back(), kFormat);
  std::memcpy(bytes, &last, sent_bytes(kFormat));
}

template <DepthFormat kFormat>
void widen(const std::byte* bytes, std::span<Key> keys) {
  constexpr std::uint64_t kMask = ~std::uint64_t{0} >> (64 - 8 * sent_bytes(kFormat));
  if (keys.empty()) return;
  for (Key& key : keys.first(keys.size() - 1)) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes, sizeof word);
    key = wide_key(word & kMask, kFormat);
    bytes += sent_bytes(kFormat);
  }
  std::uint64_t last = 0;
  std::memcpy(&last, bytes, sent_bytes(kFormat));
  keys.back() = wide_key(last, kFormat);
}

}  // namespace

void narrow_keys(std::span<const Key> keys, DepthFormat format, std::byte* bytes) {
  if (format == DepthFormat::Bits16) return narrow<DepthFormat::Bits16>(keys, bytes);
  if (format == DepthFormat::Bits24) return narrow<DepthFormat::Bits24>(keys, bytes);
  if (!keys.empty()) std::memcpy(bytes, keys.data(), keys.size_bytes());
}

void widen_keys(const std::byte* bytes, DepthFormat format, std::span<Key> keys) {
  if (format == DepthFormat::Bits16) return widen<DepthFormat::Bits16>(bytes, keys);
  if (format == DepthFormat::Bits24) return widen<DepthFormat::Bits24>(bytes, keys);
  if (!keys.empty()) std::memcpy(keys.data(), bytes, keys.size_bytes());
}

}  // namespace hpr
