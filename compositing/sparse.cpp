#include "compositing/sparse.h"

#include <algorithm>
#include <array>
#include <bit>

// Highway compiles this file once per instruction set by including it again.
#undef HWY_TARGET_INCLUDE
// NOLINTNEXTLINE(readability-identifier-naming): the name is Highway's
#define HWY_TARGET_INCLUDE "compositing/sparse.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h, as Highway asks.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace hpr {  // NOLINT(modernize-concat-nested-namespaces): HWY_NAMESPACE is a macro
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
// At most 8 lanes, so that a mask's bits fill no more than a byte.
template <typename Lane>
using LanesOf = hn::CappedTag<Lane, 8>;
using Lanes = LanesOf<Key>;

/// Of 64 pixels of one lane each.
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

/// Of 64 pixels of two lanes each.
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

/// Brings packed pixels to their places: `combine` makes the new vector of those in place, the packed ones brought to
/// their lanes, and which lanes those are. Returns how many words of the mask are done: the last few pixels, which no
/// whole vector can be loaded of, are left.
template <typename Index, typename Lane, typename Combine>
HWY_INLINE std::size_t spread_runs(Lane* tile, const std::uint64_t* mask, const Lane*& packed, const Lane* end,
                                   const Lane* places, const Combine& combine) {
  const LanesOf<Lane> lanes;
  const std::size_t step = hn::Lanes(lanes);
  for (std::size_t word = 0; word < kTilePixels / 64; ++word) {
    if (mask[word] == 0) continue;
    if (static_cast<std::size_t>(end - packed) < 64 + step) return word;
    for (std::size_t i = 0; i < 64; i += step) {
      const auto bits = static_cast<std::uint8_t>((mask[word] >> i) & ((1U << step) - 1U));
      if (bits == 0) continue;
      // Lane n takes the packed pixel that as many drawn lanes precede.
      const auto place = hn::SetTableIndices(lanes, reinterpret_cast<const Index*>(places + std::size_t{bits} * 8));
      const auto pixels = hn::TableLookupLanes(hn::LoadU(lanes, packed), place);
      Lane* const into = tile + word * 64 + i;
      hn::StoreU(combine(hn::LoadU(lanes, into), pixels, hn::LoadMaskBits(lanes, &bits)), lanes, into);
      packed += std::popcount(bits);
    }
  }
  return kTilePixels / 64;
}

/// Packed pixels replace what stands there.
std::size_t unpack_runs(std::uint32_t* tile, const std::uint64_t* mask, const std::uint32_t*& packed,
                        const std::uint32_t* end, const std::uint32_t* places) {
  return spread_runs<std::int32_t>(tile, mask, packed, end, places, [](auto in_place, auto pixels, auto drawn) {
    return hn::IfThenElse(drawn, pixels, in_place);
  });
}

/// The larger key stays.
std::size_t merge_runs(Key* tile, const std::uint64_t* mask, const Key*& packed, const Key* end,
                       const std::uint64_t* places) {
  return spread_runs<std::int64_t>(tile, mask, packed, end, places, [](auto in_place, auto keys, auto drawn) {
    return hn::Max(in_place, hn::IfThenElseZero(drawn, keys));
  });
}

}  // namespace HWY_NAMESPACE
}  // namespace hpr
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hpr {

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
constexpr LaneTable<Lane> kPlaces = [] {
  LaneTable<Lane> places{};
  for (std::size_t bits = 0; bits < 256; ++bits) {
    for (std::size_t lane = 0; lane < 8; ++lane) {
      places[bits * 8 + lane] = static_cast<Lane>(std::popcount(bits & ((std::size_t{1} << lane) - 1)));
    }
  }
  return places;
}();

/// Per place among the packed ones: the lane its key comes from; 0 past the last.
template <typename Lane>
constexpr LaneTable<Lane> kSources = [] {
  LaneTable<Lane> sources{};
  for (std::size_t bits = 0; bits < 256; ++bits) {
    std::size_t place = 0;
    for (std::size_t lane = 0; lane < 8; ++lane) {
      if ((bits >> lane & 1U) != 0) sources[bits * 8 + place++] = static_cast<Lane>(lane);
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
      HWY_DYNAMIC_DISPATCH(merge_runs)(tile.data(), mask.data(), next, end, kPlaces<std::uint64_t>.data());
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
                                        first + packed.size(), kPlaces<std::uint32_t>.data());
  unpack_from(word, packed.data() + (next - first), mask, tile);
}
void unpack_drawn(std::span<const RgbaPremultiplied> packed, const TileMask& mask,
                  std::span<RgbaPremultiplied, kTilePixels> tile) {
  unpack_from(0, packed.data(), mask, tile);
}

}  // namespace hpr
#endif
