#include "compositing/kernels.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "core/error.h"

// Highway compiles this file once per instruction set by including it again.
#undef HWY_TARGET_INCLUDE
// NOLINTNEXTLINE(readability-identifier-naming): the name is Highway's
#define HWY_TARGET_INCLUDE "compositing/kernels.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h, as Highway asks.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace hpr {  // NOLINT(modernize-concat-nested-namespaces): HWY_NAMESPACE is a macro
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

void merge(Key* into, const Key* from, std::size_t count) {
  const hn::ScalableTag<Key> tag;
  const std::size_t lanes = hn::Lanes(tag);
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    hn::StoreU(hn::Max(hn::LoadU(tag, into + i), hn::LoadU(tag, from + i)), tag, into + i);
  }
  for (; i < count; ++i) into[i] = std::max(into[i], from[i]);
}

// At most 8 lanes, so that a mask's bits fill no more than a byte.
template <typename Lane>
using LanesOf = hn::CappedTag<Lane, 8>;
using Lanes = LanesOf<Key>;

/// One bit for each of 64 pixels of one lane: is it drawn?
template <typename Lane>
std::uint64_t drawn_bits(const Lane* pixels) {
  const LanesOf<Lane> lanes;
  const auto zero = hn::Zero(lanes);
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < 64; i += hn::Lanes(lanes)) {
    std::uint8_t some[8] = {};  // NOLINT(modernize-avoid-c-arrays): what Highway fills
    hn::StoreMaskBits(lanes, hn::Ne(hn::LoadU(lanes, pixels + i), zero), some);
    bits |= static_cast<std::uint64_t>(some[0]) << i;
  }
  return bits;
}

/// One bit for each of 64 pixels of two lanes: is it drawn?
std::uint64_t drawn_bits_of_pairs(const std::uint64_t* pixels) {
  const Lanes lanes;
  const auto zero = hn::Zero(lanes);
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < 64; i += hn::Lanes(lanes)) {
    auto first = zero;
    auto second = zero;
    hn::LoadInterleaved2(lanes, pixels + 2 * i, first, second);
    std::uint8_t some[8] = {};  // NOLINT(modernize-avoid-c-arrays): what Highway fills
    hn::StoreMaskBits(lanes, hn::Ne(hn::Or(first, second), zero), some);
    bits |= static_cast<std::uint64_t>(some[0]) << i;
  }
  return bits;
}

template <std::size_t kLanesAPixel, typename Lane>
HWY_INLINE std::size_t find_in(const Lane* tile, std::uint64_t* mask) {
  std::size_t drawn = 0;
  for (std::size_t word = 0; word < kTilePixels / 64; ++word) {
    const Lane* const pixels = tile + word * 64 * kLanesAPixel;
    if constexpr (kLanesAPixel == 1) {
      mask[word] = drawn_bits(pixels);
    } else {
      mask[word] = drawn_bits_of_pairs(pixels);
    }
    drawn += static_cast<std::size_t>(std::popcount(mask[word]));
  }
  return drawn;
}

std::size_t find(const Key* tile, std::uint64_t* mask) {
  return find_in<1>(tile, mask);
}
std::size_t find_bytes(const std::uint32_t* tile, std::uint64_t* mask) {
  return find_in<1>(tile, mask);
}
std::size_t find_floats(const std::uint64_t* tile, std::uint64_t* mask) {
  return find_in<2>(tile, mask);
}

template <typename Lane, typename Index>
HWY_INLINE std::size_t pack_by(const Lane* tile, const std::uint64_t* mask, Lane* packed, const Index* sources) {
  const LanesOf<Lane> lanes;
  const std::size_t step = hn::Lanes(lanes);
  const Lane* const first = packed;
  for (std::size_t word = 0; word < kTilePixels / 64; ++word) {
    if (mask[word] == 0) continue;
    for (std::size_t i = 0; i < 64; i += step) {
      const std::size_t bits = (mask[word] >> i) & ((1U << step) - 1U);
      // By a table: Highway's own compression copies a table of its own to the stack each time.
      const auto source = hn::SetTableIndices(lanes, sources + bits * 8);
      hn::StoreU(hn::TableLookupLanes(hn::LoadU(lanes, tile + word * 64 + i), source), lanes, packed);
      packed += std::popcount(bits);
    }
  }
  return static_cast<std::size_t>(packed - first);
}

std::size_t pack(const Key* tile, const std::uint64_t* mask, Key* packed, const std::uint64_t* sources) {
  return pack_by(tile, mask, packed, reinterpret_cast<const std::int64_t*>(sources));
}
std::size_t pack_bytes(const std::uint32_t* tile, const std::uint64_t* mask, std::uint32_t* packed,
                       const std::uint32_t* sources) {
  return pack_by(tile, mask, packed, reinterpret_cast<const std::int32_t*>(sources));
}

/// Brings packed pixels to their lanes: `combine` makes the new vector of those in place, the packed ones brought to
/// their lanes, and which lanes those are. Returns how many words of the mask are done: the last few pixels, which no
/// whole vector can be loaded of, are left.
template <typename Index, typename Lane, typename Combine>
HWY_INLINE std::size_t spread_runs(Lane* tile, const std::uint64_t* mask, const Lane*& packed, const Lane* end,
                                   const Lane* index_table, const Combine& combine) {
  const LanesOf<Lane> lanes;
  const std::size_t step = hn::Lanes(lanes);
  for (std::size_t word = 0; word < kTilePixels / 64; ++word) {
    if (mask[word] == 0) continue;
    if (static_cast<std::size_t>(end - packed) < 64 + step) return word;
    for (std::size_t i = 0; i < 64; i += step) {
      const auto bits = static_cast<std::uint8_t>((mask[word] >> i) & ((1U << step) - 1U));
      if (bits == 0) continue;
      // Lane n takes the packed pixel that as many drawn lanes precede.
      const auto indices =
          hn::SetTableIndices(lanes, reinterpret_cast<const Index*>(index_table + std::size_t{bits} * 8));
      const auto pixels = hn::TableLookupLanes(hn::LoadU(lanes, packed), indices);
      Lane* const into = tile + word * 64 + i;
      hn::StoreU(combine(hn::LoadU(lanes, into), pixels, hn::LoadMaskBits(lanes, &bits)), lanes, into);
      packed += std::popcount(bits);
    }
  }
  return kTilePixels / 64;
}

/// Packed pixels replace what stands there.
std::size_t unpack_runs(std::uint32_t* tile, const std::uint64_t* mask, const std::uint32_t*& packed,
                        const std::uint32_t* end, const std::uint32_t* indices) {
  return spread_runs<std::int32_t>(tile, mask, packed, end, indices, [](auto in_place, auto pixels, auto drawn) {
    return hn::IfThenElse(drawn, pixels, in_place);
  });
}

/// The larger key stays.
std::size_t merge_runs(Key* tile, const std::uint64_t* mask, const Key*& packed, const Key* end,
                       const std::uint64_t* indices) {
  return spread_runs<std::int64_t>(tile, mask, packed, end, indices, [](auto in_place, auto keys, auto drawn) {
    return hn::Max(in_place, hn::IfThenElseZero(drawn, keys));
  });
}

#if HWY_TARGET == HWY_SCALAR

// Without vectors: a lane is one number, which has no neighbours to share an alpha with.

void blend_bytes(const std::uint8_t* front, const std::uint8_t* back, std::uint8_t* into, std::size_t count) {
  for (std::size_t pixel = 0; pixel < count; pixel += 4) {
    const unsigned let_through = 255U - front[pixel + 3];
    for (std::size_t i = pixel; i < pixel + 4; ++i) {
      const unsigned rounded = let_through * back[i] + 128;
      into[i] = static_cast<std::uint8_t>(std::min(front[i] + ((rounded + (rounded >> 8U)) >> 8U), 255U));
    }
  }
}

bool transparent(const float* pixel) {
  std::array<std::uint32_t, 4> bits{};
  std::memcpy(bits.data(), pixel, sizeof bits);
  return (bits[0] | bits[1] | bits[2] | bits[3]) == 0;
}

void blend_floats(const float* front, const float* back, float* into, std::size_t count) {
  for (std::size_t pixel = 0; pixel < count; pixel += 4) {
    const bool only_back = transparent(front + pixel);
    const bool only_front = transparent(back + pixel);
    const float let_through = 1.0F - front[pixel + 3];
    for (std::size_t i = pixel; i < pixel + 4; ++i) {
      const float sum = front[i] + let_through * back[i];
      into[i] = only_back ? back[i] : only_front ? front[i] : sum;
    }
  }
}

#else

using Bytes = hn::ScalableTag<std::uint8_t>;
using Halves = hn::Repartition<std::uint16_t, Bytes>;
using Words = hn::Repartition<std::uint32_t, Bytes>;
using Floats = hn::ScalableTag<float>;

/// x / 255 rounded to nearest, shifted up by 8 bits: 65407 at the most.
template <typename Vector>
HWY_INLINE Vector divided(Vector x) {
  const auto rounded = hn::Add(x, hn::Set(Halves(), 128));
  return hn::Add(rounded, hn::ShiftRight<8>(rounded));
}

template <typename Vector>
HWY_INLINE Vector over_bytes(Vector front, Vector back) {
  const Bytes bytes;
  const Halves halves;
  const Words words;
  const auto alpha = hn::ShiftRight<24>(hn::BitCast(words, front));
  const auto beside = hn::Sub(hn::Set(words, 255), alpha);
  const auto let_through = hn::BitCast(halves, hn::Or(beside, hn::ShiftLeft<16>(beside)));
  // Even and odd bytes apart, each with room for a product.
  const auto all = hn::BitCast(halves, back);
  const auto even = divided(hn::Mul(hn::And(all, hn::Set(halves, 0xFF)), let_through));
  const auto odd = divided(hn::Mul(hn::ShiftRight<8>(all), let_through));
  const auto behind = hn::Or(hn::ShiftRight<8>(even), hn::And(odd, hn::Set(halves, 0xFF00)));
  return hn::SaturatedAdd(front, hn::BitCast(bytes, behind));
}

/// All ones in the four lanes of every pixel whose bits are all zero.
template <typename Vector>
HWY_INLINE auto transparent(Vector pixels) {
  const hn::RebindToUnsigned<Floats> bits;
  const auto pairs = hn::Or(hn::BitCast(bits, pixels), hn::Shuffle2301(hn::BitCast(bits, pixels)));
  return hn::RebindMask(Floats(), hn::Eq(hn::Or(pairs, hn::Shuffle1032(pairs)), hn::Zero(bits)));
}

template <typename Vector>
HWY_INLINE Vector over_floats(Vector front, Vector back) {
  const Floats floats;
  const auto let_through = hn::Sub(hn::Set(floats, 1.0F), hn::Broadcast<3>(front));
  const auto sum = hn::Add(front, hn::Mul(let_through, back));
  // Where alpha is no number, or a zero is negative, the sum is not what leaving the transparent pixel out gives.
  return hn::IfThenElse(transparent(front), back, hn::IfThenElse(transparent(back), front, sum));
}

// The last pixels, too few for a vector, are padded to one, so that there is one way to blend.

void blend_bytes(const std::uint8_t* front, const std::uint8_t* back, std::uint8_t* into, std::size_t count) {
  const Bytes tag;
  const std::size_t lanes = hn::Lanes(tag);
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    hn::StoreU(over_bytes(hn::LoadU(tag, front + i), hn::LoadU(tag, back + i)), tag, into + i);
  }
  if (i == count) return;
  HWY_ALIGN std::array<std::uint8_t, HWY_MAX_BYTES> a{};
  HWY_ALIGN std::array<std::uint8_t, HWY_MAX_BYTES> b{};
  std::copy(front + i, front + count, a.begin());
  std::copy(back + i, back + count, b.begin());
  hn::Store(over_bytes(hn::Load(tag, a.data()), hn::Load(tag, b.data())), tag, a.data());
  std::copy_n(a.begin(), count - i, into + i);
}

void blend_floats(const float* front, const float* back, float* into, std::size_t count) {
  const Floats tag;
  const std::size_t lanes = hn::Lanes(tag);
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    hn::StoreU(over_floats(hn::LoadU(tag, front + i), hn::LoadU(tag, back + i)), tag, into + i);
  }
  if (i == count) return;
  HWY_ALIGN std::array<float, HWY_MAX_BYTES / sizeof(float)> a{};
  HWY_ALIGN std::array<float, HWY_MAX_BYTES / sizeof(float)> b{};
  std::copy(front + i, front + count, a.begin());
  std::copy(back + i, back + count, b.begin());
  hn::Store(over_floats(hn::Load(tag, a.data()), hn::Load(tag, b.data())), tag, a.data());
  std::copy_n(a.begin(), count - i, into + i);
}

#endif

}  // namespace HWY_NAMESPACE
}  // namespace hpr
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hpr {

HWY_EXPORT(merge);

void merge_keys(std::span<Key> into, std::span<const Key> from) {
  HPR_CHECK(into.size() == from.size());
  HWY_DYNAMIC_DISPATCH(merge)(into.data(), from.data(), into.size());
}

HWY_EXPORT(find);
HWY_EXPORT(find_bytes);
HWY_EXPORT(find_floats);
HWY_EXPORT(pack);
HWY_EXPORT(pack_bytes);
HWY_EXPORT(unpack_runs);
HWY_EXPORT(merge_runs);

namespace {

/// 8 lanes for every byte of a mask.
template <typename Lane>
using LaneTable = std::array<Lane, std::size_t{256} * 8>;

/// Per lane: how many drawn lanes stand before it, where its key stands among the packed ones.
template <typename Lane>
constexpr LaneTable<Lane> kIndices = [] {
  LaneTable<Lane> indices{};
  for (std::size_t bits = 0; bits < 256; ++bits) {
    for (std::size_t lane = 0; lane < 8; ++lane) {
      indices[bits * 8 + lane] = static_cast<Lane>(std::popcount(bits & ((std::size_t{1} << lane) - 1)));
    }
  }
  return indices;
}();

/// Per index among the packed ones: the lane its key comes from; 0 past the last.
template <typename Lane>
constexpr LaneTable<Lane> kSources = [] {
  LaneTable<Lane> sources{};
  for (std::size_t bits = 0; bits < 256; ++bits) {
    std::size_t index = 0;
    for (std::size_t lane = 0; lane < 8; ++lane) {
      if ((bits >> lane & 1U) != 0) sources[bits * 8 + index++] = static_cast<Lane>(lane);
    }
  }
  return sources;
}();

/// The pixels from a word of the mask on, one by one.
template <typename Pixel>
void unpack_from(std::size_t word, const Pixel* packed, const TileMask& mask, std::span<Pixel, kTilePixels> tile) {
  for (; word < mask.size(); ++word) {
    for (std::uint64_t rest = mask[word]; rest != 0; rest &= rest - 1) {
      tile[word * 64 + static_cast<std::size_t>(std::countr_zero(rest))] = *packed++;
    }
  }
}

}  // namespace

std::size_t find_drawn(std::span<const Key, kTilePixels> tile, TileMask& mask) {
  return HWY_DYNAMIC_DISPATCH(find)(tile.data(), mask.data());
}

std::size_t pack_drawn(std::span<const Key, kTilePixels> tile, const TileMask& mask, Key* packed) {
  return HWY_DYNAMIC_DISPATCH(pack)(tile.data(), mask.data(), packed, kSources<std::uint64_t>.data());
}

void merge_packed(std::span<Key, kTilePixels> tile, const TileMask& mask, std::span<const Key> packed) {
  const Key* next = packed.data();
  const Key* const end = next + packed.size();
  std::size_t word =
      HWY_DYNAMIC_DISPATCH(merge_runs)(tile.data(), mask.data(), next, end, kIndices<std::uint64_t>.data());
  for (; word < mask.size(); ++word) {
    for (std::uint64_t rest = mask[word]; rest != 0; rest &= rest - 1) {
      Key& key = tile[word * 64 + static_cast<std::size_t>(std::countr_zero(rest))];
      key = std::max(key, *next++);
    }
  }
}

std::size_t find_drawn(std::span<const Rgba8Premultiplied, kTilePixels> tile, TileMask& mask) {
  return HWY_DYNAMIC_DISPATCH(find_bytes)(reinterpret_cast<const std::uint32_t*>(tile.data()), mask.data());
}
std::size_t find_drawn(std::span<const RgbaPremultiplied, kTilePixels> tile, TileMask& mask) {
  return HWY_DYNAMIC_DISPATCH(find_floats)(reinterpret_cast<const std::uint64_t*>(tile.data()), mask.data());
}

std::size_t pack_drawn(std::span<const Rgba8Premultiplied, kTilePixels> tile, const TileMask& mask,
                       Rgba8Premultiplied* packed) {
  return HWY_DYNAMIC_DISPATCH(pack_bytes)(reinterpret_cast<const std::uint32_t*>(tile.data()), mask.data(),
                                          reinterpret_cast<std::uint32_t*>(packed), kSources<std::uint32_t>.data());
}
std::size_t pack_drawn(std::span<const RgbaPremultiplied, kTilePixels> tile, const TileMask& mask,
                       RgbaPremultiplied* packed) {
  std::size_t count = 0;
  for (std::size_t word = 0; word < mask.size(); ++word) {
    for (std::uint64_t rest = mask[word]; rest != 0; rest &= rest - 1) {
      packed[count++] = tile[word * 64 + static_cast<std::size_t>(std::countr_zero(rest))];
    }
  }
  return count;
}

void unpack_drawn(std::span<const Rgba8Premultiplied> packed, const TileMask& mask,
                  std::span<Rgba8Premultiplied, kTilePixels> tile) {
  const auto* next = reinterpret_cast<const std::uint32_t*>(packed.data());
  const auto* const first = next;
  const std::size_t word =
      HWY_DYNAMIC_DISPATCH(unpack_runs)(reinterpret_cast<std::uint32_t*>(tile.data()), mask.data(), next,
                                        first + packed.size(), kIndices<std::uint32_t>.data());
  unpack_from(word, packed.data() + (next - first), mask, tile);
}
void unpack_drawn(std::span<const RgbaPremultiplied> packed, const TileMask& mask,
                  std::span<RgbaPremultiplied, kTilePixels> tile) {
  unpack_from(0, packed.data(), mask, tile);
}

HWY_EXPORT(blend_bytes);
HWY_EXPORT(blend_floats);

void composite_over(std::span<const Rgba8Premultiplied> front, std::span<const Rgba8Premultiplied> back,
                    std::span<Rgba8Premultiplied> into) {
  HPR_CHECK(front.size() == into.size() && back.size() == into.size());
  HWY_DYNAMIC_DISPATCH(blend_bytes)
  (reinterpret_cast<const std::uint8_t*>(front.data()), reinterpret_cast<const std::uint8_t*>(back.data()),
   reinterpret_cast<std::uint8_t*>(into.data()), into.size_bytes());
}

void composite_over(std::span<const RgbaPremultiplied> front, std::span<const RgbaPremultiplied> back,
                    std::span<RgbaPremultiplied> into) {
  HPR_CHECK(front.size() == into.size() && back.size() == into.size());
  HWY_DYNAMIC_DISPATCH(blend_floats)
  (reinterpret_cast<const float*>(front.data()), reinterpret_cast<const float*>(back.data()),
   reinterpret_cast<float*>(into.data()), into.size() * 4);
}

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
#endif
